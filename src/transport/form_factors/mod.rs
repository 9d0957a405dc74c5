//! Form factors: the fraction of the power leaving one surface that arrives at another.
//!
//! [`polygon`] is Lambert's closed form for what nothing stands between.

pub mod polygon;

mod lambert;
