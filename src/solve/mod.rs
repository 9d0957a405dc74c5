//! Patches and form factors -> radiosity: the coarse solution of all interreflection.
