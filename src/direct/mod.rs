//! Light from emitters straight to every element.
