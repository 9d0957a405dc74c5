//! Document + atlas + lightmap -> files.
