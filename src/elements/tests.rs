//! What rasterisation promises, on small scenes.

mod among_others;
mod footprints;
mod groups;
