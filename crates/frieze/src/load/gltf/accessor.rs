//! Accessors: typed views of bytes, read with every bound checked and nothing allocated before the bytes for it
//! are known to exist (glTF 2.0, 3.6.2).

use super::json::{self, Document};
use crate::error::{Error, Result};
use crate::load::Context;
use crate::load::files::Blob;
use bytemuck::Pod;
use rayon::prelude::*;
use std::ops::Range;

/// Bytes that one task reads at a time: small enough to stay in a core's cache for the checks.
const CHUNK: usize = 1 << 18;

/// Most elements of an accessor that has no bytes of its own (all zeros, 3.6.2.3).
const MOST_ZEROS: u64 = 1 << 22;

/// The number types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn new(code: u32) -> Option<Component> {
        Some(match code {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            _ => return None,
        })
    }
    fn size(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }
    /// A number as a float; normalised integers as 0 ..= 1 and -1 ..= 1 (3.11).
    #[inline(always)]
    fn float(self, b: &[u8], normalized: bool) -> f32 {
        let (value, scale) = match self {
            Component::F32 => return f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            Component::U32 => return u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
            Component::I8 => (f32::from(b[0] as i8), 127.0),
            Component::U8 => (f32::from(b[0]), 255.0),
            Component::I16 => (f32::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
            Component::U16 => (f32::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
        };
        if normalized { (value / scale).max(-1.0) } else { value }
    }
    /// An unsigned integer; 0 for other types.
    #[inline(always)]
    fn unsigned(self, b: &[u8]) -> u32 {
        match self {
            Component::U8 => u32::from(b[0]),
            Component::U16 => u32::from(u16::from_le_bytes([b[0], b[1]])),
            Component::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            Component::I8 | Component::I16 | Component::F32 => 0,
        }
    }
}

/// The document with its buffers: what accessors need.
pub struct Data<'a> {
    /// The document.
    pub document: &'a Document,
    /// The buffers, as long as they should be.
    pub buffers: Vec<Blob<'a>>,
    /// Budget and cancellation.
    pub context: &'a Context<'a>,
}

/// Elements that lie in a blob, `stride` bytes apart. The blob holds them all.
struct Elements<'a> {
    blob: Option<Blob<'a>>,
    count: u64,
    stride: usize,
    component: Component,
    width: usize,
    normalized: bool,
}

fn pointer(kind: &str, index: u32) -> String {
    format!("/{kind}/{index}")
}

/// The item of that index, or an error that names who asked.
pub fn item<'d, T>(list: &'d [T], kind: &str, index: u32) -> Result<&'d T> {
    list.get(index as usize).ok_or_else(|| {
        Error::input("gltf.no-such-item", format!("there is no /{kind}/{index}: there are {}", list.len()))
            .remedy("the file is broken; export it again")
    })
}

impl<'a> Data<'a> {
    /// The bytes of a buffer view and its stride.
    pub fn view(&self, index: u32) -> Result<(Blob<'a>, Option<u64>)> {
        let view = item(&self.document.buffer_views, "bufferViews", index)?;
        let buffer = item(&self.buffers, "buffers", view.buffer).map_err(|e| e.at(pointer("bufferViews", index)))?;
        let blob = buffer.slice(view.byte_offset, view.byte_length).ok_or_else(|| {
            let message = format!(
                "bytes {} + {} lie outside of buffer {}, which has {}",
                view.byte_offset,
                view.byte_length,
                view.buffer,
                buffer.len()
            );
            Error::input("gltf.view-out-of-range", message).at(pointer("bufferViews", index))
        })?;
        if view.byte_stride.is_some_and(|s| s > 252) {
            return Err(Error::input("gltf.stride", "byteStride is over 252").at(pointer("bufferViews", index)));
        }
        Ok((blob, view.byte_stride.filter(|&s| s > 0)))
    }

    /// How many elements of `width` components an accessor has; their bytes exist.
    pub fn count(&self, index: u32, width: usize) -> Result<u64> {
        Ok(self.elements(index, width)?.1.count)
    }

    /// The elements of an accessor without its sparse part, proven to lie within their buffer view.
    fn elements(&self, index: u32, width: usize) -> Result<(&'a json::Accessor, Elements<'a>)> {
        let accessor = item(&self.document.accessors, "accessors", index)?;
        let bad = |code, message: String| Error::input(code, message).at(pointer("accessors", index));
        let have = match accessor.kind.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            other => {
                let message = format!("the type is {other:.20?}, not SCALAR, VEC2, VEC3 or VEC4");
                return Err(bad("gltf.accessor-type", message));
            }
        };
        if have != width {
            let message = format!("the type has {have} components where {width} are needed");
            return Err(bad("gltf.accessor-type", message));
        }
        let component = Component::new(accessor.component_type).ok_or_else(|| {
            bad("gltf.component-type", format!("there is no component type {}", accessor.component_type))
        })?;
        let size = (width * component.size()) as u64;
        let mut elements = Elements {
            blob: None,
            count: accessor.count,
            stride: size as usize,
            component,
            width,
            normalized: accessor.normalized,
        };
        match accessor.buffer_view {
            Some(view) => {
                let (blob, stride) = self.view(view).map_err(|e| e.at(pointer("accessors", index)))?;
                let stride = stride.unwrap_or(size);
                elements.stride = stride as usize;
                elements.blob =
                    Some(within(&blob, accessor.byte_offset, accessor.count, stride, size).ok_or_else(|| {
                        let message = format!(
                            "{} elements of {size} bytes do not fit into buffer view {view}, which has {} bytes",
                            accessor.count,
                            blob.len()
                        );
                        bad("gltf.accessor-out-of-range", message)
                    })?);
            }
            None if accessor.count > MOST_ZEROS => {
                let message = format!("{} elements have no buffer view; {MOST_ZEROS} are possible", accessor.count);
                return Err(bad("gltf.accessor-out-of-range", message));
            }
            None => {}
        }
        Ok((accessor, elements))
    }

    /// Vectors of floats, as the accessor has them in `range`, and the first that is not finite.
    pub fn floats<const N: usize>(&self, index: u32, range: Range<u64>) -> Result<(Vec<[f32; N]>, Option<usize>)>
    where
        [f32; N]: Pod,
    {
        let (accessor, elements) = self.elements(index, N)?;
        let len = range.end - range.start;
        self.context.reserve(len * (4 * N) as u64, "vertex data").map_err(|e| e.at(pointer("accessors", index)))?;
        let (component, normalized) = (elements.component, elements.normalized);
        let each = component.size();
        let convert = |bytes: &[u8]| core::array::from_fn(|k| component.float(&bytes[k * each..], normalized));
        let tight = component == Component::F32 && elements.stride == 4 * N;
        let mut out = elements.read(&range, tight, convert).map_err(|e| e.at(pointer("accessors", index)))?;
        if let Some(sparse) = &accessor.sparse {
            self.sparse(index, sparse, accessor.count, &elements, &range, &mut out, convert)?;
        }
        let bad = first(&out, |chunk| {
            // The largest exponent tells, without a branch per number, whether any is infinite or NaN.
            let largest = chunk.iter().flatten().fold(0, |m, v| m.max(v.to_bits() & 0x7fff_ffff));
            let at = || chunk.iter().position(|v| v.iter().any(|v| !v.is_finite()));
            (largest >= 0x7f80_0000).then(at).flatten()
        });
        Ok((out, bad))
    }

    /// Vertex indices, with the smallest and the largest; `None` for those when there are no indices.
    pub fn indices(&self, index: u32) -> Result<(Vec<u32>, Option<(u32, u32)>)> {
        let (accessor, elements) = self.elements(index, 1)?;
        let component = elements.component;
        if !matches!(component, Component::U8 | Component::U16 | Component::U32) || elements.normalized {
            let message = "vertex indices must be unsigned integers that are not normalised";
            return Err(Error::input("gltf.component-type", message).at(pointer("accessors", index)));
        }
        let range = 0..accessor.count;
        self.context.reserve(accessor.count * 4, "vertex indices").map_err(|e| e.at(pointer("accessors", index)))?;
        let tight = component == Component::U32 && elements.stride == 4;
        let convert = |bytes: &[u8]| component.unsigned(bytes);
        let mut out = elements.read(&range, tight, convert).map_err(|e| e.at(pointer("accessors", index)))?;
        if let Some(sparse) = &accessor.sparse {
            self.sparse(index, sparse, accessor.count, &elements, &range, &mut out, convert)?;
        }
        let ends = |a: (u32, u32), b: (u32, u32)| (a.0.min(b.0), a.1.max(b.1));
        let ends = out
            .par_chunks(CHUNK)
            .map(|c| c.iter().fold((u32::MAX, 0), |m, &i| (m.0.min(i), m.1.max(i))))
            .reduce(|| (u32::MAX, 0), ends);
        let ends = (!out.is_empty()).then_some(ends);
        Ok((out, ends))
    }

    /// Puts the sparse values in place (3.6.2.3).
    fn sparse<T: Copy>(
        &self,
        index: u32,
        sparse: &json::Sparse,
        count: u64,
        like: &Elements<'_>,
        range: &Range<u64>,
        out: &mut [T],
        convert: impl Fn(&[u8]) -> T,
    ) -> Result<()> {
        let place = || format!("/accessors/{index}/sparse");
        let bad = |code, message: String| Error::input(code, message).at(place());
        if sparse.count > count {
            return Err(bad("gltf.sparse", format!("{} sparse values for {count} elements", sparse.count)));
        }
        let component = Component::new(sparse.indices.component_type)
            .filter(|c| matches!(c, Component::U8 | Component::U16 | Component::U32))
            .ok_or_else(|| bad("gltf.component-type", "sparse indices must be unsigned integers".into()))?;
        let read = |part: &json::SparsePart, size: usize| -> Result<Vec<u8>> {
            let (blob, _) = self.view(part.buffer_view).map_err(|e| e.at(place()))?;
            let blob = within(&blob, part.byte_offset, sparse.count, size as u64, size as u64)
                .ok_or_else(|| bad("gltf.accessor-out-of-range", "sparse data lie outside of their view".into()))?;
            let _held = self.context.job.reserve(blob.len(), "sparse data")?;
            let mut bytes = vec![0; blob.len() as usize];
            blob.read_at(0, &mut bytes)?;
            Ok(bytes)
        };
        let size = like.width * like.component.size();
        let indices = read(&sparse.indices, component.size())?;
        let values = read(&sparse.values, size)?;
        for (at, value) in indices.chunks_exact(component.size()).zip(values.chunks_exact(size)) {
            let at = u64::from(component.unsigned(at));
            if at >= count {
                return Err(bad("gltf.sparse", format!("sparse index {at} for {count} elements")));
            }
            if range.contains(&at) {
                out[(at - range.start) as usize] = convert(value);
            }
        }
        Ok(())
    }
}

/// The part of a view that holds `count` elements of `size` bytes, `stride` apart.
fn within<'a>(view: &Blob<'a>, offset: u64, count: u64, stride: u64, size: u64) -> Option<Blob<'a>> {
    let len = match count.checked_sub(1) {
        Some(before) => before.checked_mul(stride)?.checked_add(size)?,
        None => 0,
    };
    view.slice(offset, len)
}

/// The first index for which `find`, which is asked chunk by chunk, has an answer.
fn first<T: Sync>(all: &[T], find: impl Fn(&[T]) -> Option<usize> + Sync) -> Option<usize> {
    let size = (CHUNK / size_of::<T>().max(1)).max(1);
    let found = |(k, chunk): (usize, &[T])| find(chunk).map(|at| k * size + at);
    all.par_chunks(size).enumerate().map(found).find_first(Option::is_some).flatten()
}

impl Elements<'_> {
    /// The elements of `range`, in parallel. `tight`: they lie in the file as they do in memory.
    fn read<T: Pod + Send>(
        &self,
        range: &Range<u64>,
        tight: bool,
        convert: impl Fn(&[u8]) -> T + Sync,
    ) -> Result<Vec<T>> {
        debug_assert!(range.end <= self.count);
        let mut out: Vec<T> = vec![T::zeroed(); (range.end - range.start) as usize];
        let Some(blob) = &self.blob else { return Ok(out) };
        let size = self.width * self.component.size();
        let chunk = (CHUNK / self.stride).max(1);
        let fill = |(k, out): (usize, &mut [T])| -> Result<()> {
            let begin = (range.start + (k * chunk) as u64) * self.stride as u64;
            if tight && cfg!(target_endian = "little") {
                return blob.read_at(begin, bytemuck::cast_slice_mut(out));
            }
            let mut bytes = vec![0; (out.len() - 1) * self.stride + size];
            blob.read_at(begin, &mut bytes)?;
            for (k, out) in out.iter_mut().enumerate() {
                *out = convert(&bytes[k * self.stride..]);
            }
            Ok(())
        };
        let done: Vec<Result<()>> = out.par_chunks_mut(chunk).enumerate().map(fill).collect();
        // The first error in file order, whichever thread was first.
        done.into_iter().collect::<Result<()>>()?;
        Ok(out)
    }
}
