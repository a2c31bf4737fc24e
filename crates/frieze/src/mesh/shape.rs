//! Built-in shapes, made by code.
