//! What every tracer must answer, checked against trying every triangle.

mod shapes;
mod tracers;
