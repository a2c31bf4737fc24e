//! PNG, JPEG, WebP, TGA, BMP, TIFF, Radiance HDR and EXR: told by the first bytes, TGA by their absence.
#![no_main]

use frieze_fuzz::picture;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    picture(data);
});
