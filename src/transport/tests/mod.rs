//! What every tracer must answer, checked against trying every triangle.

mod boxes;
mod offsets;
mod processors;
mod shafts;
mod shapes;
mod tracers;
mod watertight;
