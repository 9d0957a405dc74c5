//! The command line: fills options, prints reports, sets exit codes.
