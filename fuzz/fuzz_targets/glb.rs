//! GLB files. Input that does not begin like one is a document, a zero byte and a buffer, and gets the frame of a
//! GLB with the right lengths, so that what is inside is reached.
#![no_main]

use frieze_fuzz::{halves, model};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    if data.starts_with(b"glTF") {
        model("glb", data);
    } else {
        let (json, bin) = halves(data);
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend(((28 + json.len() + bin.len()) as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", json), (b"BIN\0", bin)] {
            out.extend((chunk.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        model("glb", &out);
    }
});
