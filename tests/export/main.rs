//! What the export does to a file, rule by rule.

mod containers;
mod files;
mod kit;
mod materials;
mod nodes;
mod vertices;
