//! glTF documents whose buffers and pictures are embedded, or files beside them.
#![no_main]

use frieze_fuzz::Folder;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    Folder::get().put("a.gltf", data);
    Folder::get().load("a.gltf");
});
