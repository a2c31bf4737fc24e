//! STL models.
#![no_main]

use frieze_fuzz::model;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    model("stl", data);
});
