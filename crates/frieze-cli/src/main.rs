//! The program `frieze`: what was typed, what was meant, a verb of the library, an exit code.
fn main() {}
