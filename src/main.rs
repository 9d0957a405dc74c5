//! The `lightkiln` command.

fn main() {}
