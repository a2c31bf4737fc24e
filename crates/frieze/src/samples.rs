//! The built-in scenes, all made by code.
