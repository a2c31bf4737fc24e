//! STL models.
#![no_main]

use frieze::load::load_bytes;
use frieze_fuzz::{follow, options};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    follow(load_bytes("stl", data, options()));
});
