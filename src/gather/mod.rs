//! Coarse radiosity -> indirect irradiance of every element.
