//! Scene files, with models and pictures beside them.
#![no_main]

use frieze_fuzz::Folder;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    Folder::get().put("a.toml", data);
    Folder::get().load("a.toml");
});
