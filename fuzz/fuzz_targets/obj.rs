//! OBJ models, and after the first zero byte the MTL file `a.mtl`.
#![no_main]

use frieze_fuzz::{Folder, halves};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let (obj, mtl) = halves(data);
    Folder::get().put("a.obj", obj);
    Folder::get().put("a.mtl", mtl);
    Folder::get().load("a.obj");
});
