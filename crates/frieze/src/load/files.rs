//! Files that an asset names: looked for beside it, never outside of its folder.
//!
//! A model from the network may name any path. So a relative path is checked as text first (which tells nothing
//! about what exists outside), then resolved with all symbolic links and checked again.

use crate::error::{Error, Finding, Result};
use crate::job::{Job, Reservation};
use std::fs::File;
use std::io;
use std::ops::Deref;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// Most bytes of an image, material or buffer file that a model names.
pub const LIMIT: u64 = 1 << 36;

/// What to do about a file that is shorter than it says.
pub(super) const CUT_OFF: &str = "the file may be cut off: copy, download or export it again";

const OUTSIDE: &str = "move the file beside the model, or allow it with --allow-outside";

/// The folder of an asset, and the folder that its files may not leave.
#[derive(Clone, Debug)]
pub struct Root {
    /// Where relative paths begin; canonical. `None`: there are no files.
    base: Option<PathBuf>,
    /// What they may not leave; canonical. `None`: anything goes.
    fence: Option<PathBuf>,
}

impl Root {
    /// The folder of the asset at `asset`, which its files may not leave unless `allow_outside`.
    ///
    /// # Errors
    /// `file.missing` when there is no such folder.
    pub fn of(asset: &Path, allow_outside: bool) -> Result<Root> {
        let base = folder_of(asset)?;
        Ok(Root { fence: (!allow_outside).then(|| base.clone()), base: Some(base) })
    }
    /// No folder: every file is missing.
    pub fn nowhere() -> Root {
        Root { base: None, fence: None }
    }
    /// The same fence, with relative paths that begin beside `asset`.
    ///
    /// # Errors
    /// As [`Root::of`].
    pub fn beside(&self, asset: &Path) -> Result<Root> {
        Ok(Root { base: Some(folder_of(asset)?), fence: self.fence.clone() })
    }

    /// The canonical path of a file that an asset names. Backslashes count as slashes.
    ///
    /// # Errors
    /// `file.url`, `file.outside` (absolute paths, drives, `..` and links that leave the folder), `file.missing`,
    /// `file.name`.
    pub fn resolve(&self, relative: &str) -> Result<PathBuf> {
        self.find(relative).map(|found| found.0)
    }

    /// As [`Root::resolve`], with a finding when upper and lower case had to be ignored.
    fn find(&self, relative: &str) -> Result<(PathBuf, Option<Finding>)> {
        let quoted = shown(relative);
        if relative.is_empty() || relative.contains('\0') || relative.len() > 4096 {
            return Err(Error::input("file.name", format!("{quoted} is no file name")));
        }
        let scheme = relative.split(':').next().filter(|s| s.len() > 1 && s.len() < relative.len());
        if scheme.is_some_and(|s| s.bytes().all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b))) {
            return Err(Error::input("file.url", format!("{quoted} is an address, not a file"))
                .remedy("download the file beside the model and name it there"));
        }
        let Some(base) = &self.base else {
            return Err(Error::input("file.missing", format!("there is no folder to look for {quoted} in")));
        };
        let slashed = relative.replace('\\', "/");
        let drive = slashed.len() > 1 && slashed.as_bytes()[1] == b':' && slashed.as_bytes()[0].is_ascii_alphabetic();
        let outside =
            |why: &str| Error::input("file.outside", format!("{quoted} {why}, and is not read")).remedy(OUTSIDE);
        if self.fence.is_some() && (drive || slashed.starts_with('/')) {
            return Err(outside("is an absolute path"));
        }
        let wanted = if drive { PathBuf::from(relative) } else { lexical(&base.join(&slashed)) };
        if let Some(fence) = &self.fence
            && !wanted.starts_with(fence)
        {
            return Err(outside("leaves the folder"));
        }
        let mut finding = None;
        let real = match wanted.canonicalize() {
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                let other = self.fence.as_ref().and_then(|fence| ignoring_case(fence, &wanted));
                let other = other.ok_or_else(|| {
                    Error::input("file.missing", format!("there is no file {quoted}"))
                        .remedy("put the file where the model expects it")
                })?;
                finding = Some(Finding::note(
                    "file.case",
                    format!("there is no {quoted}, but a file that differs in upper and lower case"),
                    format!("used {}", other.display()),
                ));
                other.canonicalize()
            }
            other => other,
        }
        .map_err(|e| unreadable(&wanted, &e))?;
        if let Some(fence) = &self.fence
            && !real.starts_with(fence)
        {
            return Err(outside("is a link that leaves the folder"));
        }
        Ok((real, finding))
    }

    /// Opens a file that an asset names, for reading in parts.
    ///
    /// # Errors
    /// As [`Root::resolve`]; `file.unreadable`; `file.size` over `limit` bytes.
    pub fn open(&self, relative: &str, limit: u64) -> Result<Blob<'static>> {
        open_limited(&self.resolve(relative)?, limit)
    }

    /// Reads a file that an asset names. Its size is asked from `job` before, and given back with the bytes.
    ///
    /// # Errors
    /// As [`Root::open`]; [`crate::error::Fault::Memory`] over the budget.
    pub fn read(&self, relative: &str, limit: u64, job: &Job) -> Result<Bytes> {
        read_path(&self.resolve(relative)?, limit, job)
    }

    /// Reads an image or material file. Absolute paths of the author's machine and other places where nothing is
    /// are common in MTL files; then a file of that name beside the model is taken, with a finding.
    ///
    /// # Errors
    /// As [`Root::read`].
    pub fn read_or_beside(&self, relative: &str, limit: u64, job: &Job) -> Result<(Bytes, Option<Finding>)> {
        let (path, finding) = match self.find(relative) {
            Ok(found) => found,
            Err(error) => {
                let last = relative.rsplit(['/', '\\']).next().unwrap_or_default();
                if last == relative || last.contains(':') || error.code == "file.url" {
                    return Err(error);
                }
                let Ok((path, _)) = self.find(last) else { return Err(error) };
                let finding = Finding::warning(
                    "file.elsewhere",
                    error.message,
                    format!("used the file of the same name, {}", path.display()),
                );
                (path, Some(finding))
            }
        };
        Ok((read_path(&path, limit, job)?, finding))
    }
}

/// A file name as a message shows it: quoted, control characters escaped, not too long.
fn shown(name: &str) -> String {
    let mut short: String = name.chars().take(120).collect();
    if short.len() < name.len() {
        short.push_str("...");
    }
    format!("{short:?}")
}

fn folder_of(asset: &Path) -> Result<PathBuf> {
    let folder = asset.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    folder.canonicalize().map_err(|e| unreadable(asset, &e))
}

fn unreadable(path: &Path, e: &io::Error) -> Error {
    match e.kind() {
        io::ErrorKind::NotFound if path.as_os_str() == "-" => Error::input("file.missing", "stdin is not read")
            .in_file(path)
            .remedy("write what comes there to a file, and give that file's name"),
        io::ErrorKind::NotFound => Error::input("file.missing", "there is no such file")
            .in_file(path)
            .remedy("check the path; it counts from the folder that the program was started in"),
        _ => Error::input("file.unreadable", format!("cannot be read: {e}")).in_file(path),
    }
}

/// `a/./b/../c` is `a/c`, without a look at the disk.
fn lexical(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

/// The path below `fence` that differs from `wanted` in ASCII case only; the first in byte order.
fn ignoring_case(fence: &Path, wanted: &Path) -> Option<PathBuf> {
    let mut found = fence.to_owned();
    for component in wanted.strip_prefix(fence).ok()?.components() {
        let name = component.as_os_str();
        if found.join(name).symlink_metadata().is_ok() {
            found.push(name);
            continue;
        }
        let names = found.read_dir().ok()?.take(100_000).filter_map(|e| e.ok().map(|e| e.file_name()));
        found.push(names.filter(|n| n.eq_ignore_ascii_case(name)).min()?);
    }
    Some(found)
}

/// Opens a file by the path that the user or [`Root::resolve`] gave.
fn open_limited(path: &Path, limit: u64) -> Result<Blob<'static>> {
    let blob = Blob::open(path)?;
    if blob.len() > limit {
        let message = format!("the file has {} MiB; {} are possible", blob.len() >> 20, limit >> 20);
        return Err(Error::input("file.size", message).in_file(path));
    }
    Ok(blob)
}

/// Reads a whole file by the path that the user or [`Root::resolve`] gave; the size is asked from `job` before.
///
/// # Errors
/// `file.missing`, `file.unreadable`, `file.size` over `limit`; [`crate::error::Fault::Memory`].
pub fn read_path(path: &Path, limit: u64, job: &Job) -> Result<Bytes> {
    let blob = open_limited(path, limit)?;
    let held = job.reserve(blob.len(), format_args!("the file {}", path.display()))?;
    let mut data = vec![0; blob.len() as usize];
    blob.read_at(0, &mut data).map_err(|e| e.in_file(path))?;
    Ok(Bytes { data, path: path.to_owned(), _held: held })
}

/// A file's bytes, counted in the job's budget as long as they live.
#[derive(Debug)]
pub struct Bytes {
    data: Vec<u8>,
    /// The file.
    pub path: PathBuf,
    _held: Reservation,
}

impl Deref for Bytes {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.data
    }
}

/// Bytes that are read in parts, from any thread: a file, or memory.
#[derive(Clone, Debug)]
pub struct Blob<'a> {
    source: Source<'a>,
    start: u64,
    len: u64,
}

#[derive(Clone, Debug)]
enum Source<'a> {
    File(Arc<Positioned>),
    Memory(&'a [u8]),
    Owned(Arc<Vec<u8>>),
}

impl<'a> From<&'a [u8]> for Blob<'a> {
    fn from(bytes: &'a [u8]) -> Self {
        Blob { source: Source::Memory(bytes), start: 0, len: bytes.len() as u64 }
    }
}

impl From<Vec<u8>> for Blob<'_> {
    fn from(bytes: Vec<u8>) -> Self {
        let len = bytes.len() as u64;
        Blob { source: Source::Owned(Arc::new(bytes)), start: 0, len }
    }
}

impl Blob<'static> {
    /// Opens a regular file. Pipes and devices are refused: their length is not known before.
    ///
    /// # Errors
    /// `file.missing`, `file.unreadable`.
    pub fn open(path: &Path) -> Result<Self> {
        // Asked before opening: opening a pipe would wait for its other end.
        let what = std::fs::metadata(path).map_err(|e| unreadable(path, &e))?;
        if what.is_dir() {
            return Err(Error::input("file.unreadable", "this is a folder, not a file")
                .in_file(path)
                .remedy("give the name of a file in it"));
        }
        if !what.is_file() {
            return Err(Error::input("file.unreadable", "this is a pipe or a device, not a file").in_file(path));
        }
        let file = File::open(path).map_err(|e| unreadable(path, &e))?;
        let len = file.metadata().map_err(|e| unreadable(path, &e))?.len();
        Ok(Blob { source: Source::File(Arc::new(Positioned::new(file))), start: 0, len })
    }
}

impl<'a> Blob<'a> {
    /// How many bytes there are.
    pub fn len(&self) -> u64 {
        self.len
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
    /// A part; `None` when it does not lie within.
    pub fn slice(&self, offset: u64, len: u64) -> Option<Blob<'a>> {
        (offset.checked_add(len)? <= self.len).then(|| Blob {
            source: self.source.clone(),
            start: self.start + offset,
            len,
        })
    }
    /// Fills `out` from `offset`.
    ///
    /// # Errors
    /// `file.truncated` beyond the end (or when the file has become shorter), `file.unreadable`.
    pub fn read_at(&self, offset: u64, out: &mut [u8]) -> Result<()> {
        let beyond = || {
            Error::input("file.truncated", "the file ends too early").at(format!("byte {}", self.len)).remedy(CUT_OFF)
        };
        if offset.checked_add(out.len() as u64).is_none_or(|end| end > self.len) {
            return Err(beyond());
        }
        let at = self.start + offset;
        let memory = match &self.source {
            Source::File(file) => {
                return file.read_exact_at(out, at).map_err(|e| match e.kind() {
                    io::ErrorKind::UnexpectedEof => beyond(),
                    _ => Error::input("file.unreadable", format!("cannot be read: {e}")),
                });
            }
            Source::Memory(bytes) => bytes,
            Source::Owned(bytes) => &bytes[..],
        };
        out.copy_from_slice(&memory[at as usize..][..out.len()]);
        Ok(())
    }
    /// The bytes without a copy, if they are in memory.
    pub fn memory(&self) -> Option<&[u8]> {
        match &self.source {
            Source::File(_) => None,
            Source::Memory(bytes) => Some(&bytes[self.start as usize..][..self.len as usize]),
            Source::Owned(bytes) => Some(&bytes[self.start as usize..][..self.len as usize]),
        }
    }
    /// All bytes, copied only when they are in a file; `read` is where they are kept then.
    ///
    /// # Errors
    /// As [`Blob::read_at`]; [`crate::error::Fault::Memory`] over the budget.
    pub fn bytes<'b>(&'b self, job: &Job, read: &'b mut Option<Bytes>) -> Result<&'b [u8]> {
        if let Some(bytes) = self.memory() {
            return Ok(bytes);
        }
        let held = job.reserve(self.len, "the file")?;
        let mut data = vec![0; self.len as usize];
        self.read_at(0, &mut data)?;
        Ok(read.insert(Bytes { data, path: PathBuf::new(), _held: held }))
    }
}

/// A file that is read at positions, by several threads.
#[derive(Debug)]
struct Positioned {
    #[cfg(unix)]
    file: File,
    #[cfg(not(unix))]
    file: std::sync::Mutex<File>,
}

impl Positioned {
    #[cfg(unix)]
    fn new(file: File) -> Self {
        Positioned { file }
    }
    #[cfg(unix)]
    fn read_exact_at(&self, out: &mut [u8], at: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(&self.file, out, at)
    }
    #[cfg(not(unix))]
    fn new(file: File) -> Self {
        Positioned { file: std::sync::Mutex::new(file) }
    }
    #[cfg(not(unix))]
    fn read_exact_at(&self, out: &mut [u8], at: u64) -> io::Result<()> {
        use std::io::{Read, Seek};
        let mut file = self.file.lock().expect("no thread panics while it reads");
        file.seek(io::SeekFrom::Start(at))?;
        file.read_exact(out)
    }
}

/// Decodes `%20` and its like (RFC 3986, 2.1), as glTF addresses have them. A percent sign without two
/// hexadecimal digits stays what it is; `None` when the result is no UTF-8.
pub fn percent_decoded(uri: &str) -> Option<String> {
    let hex = |b: u8| (b as char).to_digit(16).map(|d| d as u8);
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut k = 0;
    while k < bytes.len() {
        let digits = (bytes[k] == b'%').then(|| Some((hex(*bytes.get(k + 1)?)?, hex(*bytes.get(k + 2)?)?))).flatten();
        out.push(digits.map_or(bytes[k], |(high, low)| high << 4 | low));
        k += if digits.is_some() { 3 } else { 1 };
    }
    String::from_utf8(out).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A new folder that is removed at the end of the test.
    struct Folder(PathBuf);
    impl Folder {
        fn new(name: &str) -> Folder {
            let path = std::env::temp_dir().join(format!("frieze-files-{name}-{}", std::process::id()));
            let _ = std::fs::remove_dir_all(&path);
            std::fs::create_dir_all(path.join("asset/sub")).unwrap();
            std::fs::write(path.join("secret.txt"), "secret").unwrap();
            std::fs::write(path.join("asset/model.obj"), "").unwrap();
            std::fs::write(path.join("asset/sub/Wood.PNG"), "wood").unwrap();
            Folder(path)
        }
        fn root(&self, allow_outside: bool) -> Root {
            Root::of(&self.0.join("asset/model.obj"), allow_outside).unwrap()
        }
    }
    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    fn code(root: &Root, path: &str) -> &'static str {
        root.read(path, 100, &Job::default()).map_or_else(|e| e.code, |_| "read")
    }

    #[test]
    fn nothing_outside_of_the_folder_is_read() {
        let folder = Folder::new("outside");
        let root = folder.root(false);
        let secret = folder.0.join("secret.txt");
        for path in [secret.to_str().unwrap(), "../secret.txt", "sub/../../secret.txt", "..\\secret.txt", "/etc/passwd"]
        {
            assert_eq!(code(&root, path), "file.outside", "{path}");
        }
        for path in ["C:\\secret.txt", "c:secret.txt", "\\\\server\\share\\x", "//server/x"] {
            assert_eq!(code(&root, path), "file.outside", "{path}");
        }
        for path in ["http://a/b.png", "file:///etc/passwd", "data:,x"] {
            assert_eq!(code(&root, path), "file.url", "{path}");
        }
        // What is outside must not be told apart by whether it exists.
        assert_eq!(code(&root, "../nothing.txt"), "file.outside");
        assert_eq!(code(&root, ""), "file.name");
        assert_eq!(code(&root, "a\0b"), "file.name");
        assert_eq!(code(&root, "sub"), "file.unreadable");
        assert_eq!(code(&folder.root(true), "../secret.txt"), "read");
        assert_eq!(code(&folder.root(true), secret.to_str().unwrap()), "read");
    }

    #[cfg(unix)]
    #[test]
    fn links_that_leave_the_folder_are_refused() {
        let folder = Folder::new("links");
        std::os::unix::fs::symlink(folder.0.join("secret.txt"), folder.0.join("asset/link.txt")).unwrap();
        std::os::unix::fs::symlink(&folder.0, folder.0.join("asset/up")).unwrap();
        std::os::unix::fs::symlink("sub/Wood.PNG", folder.0.join("asset/inside.png")).unwrap();
        let root = folder.root(false);
        assert_eq!(code(&root, "link.txt"), "file.outside");
        assert_eq!(code(&root, "up/secret.txt"), "file.outside");
        assert_eq!(code(&root, "inside.png"), "read");
        assert_eq!(code(&folder.root(true), "link.txt"), "read");
    }

    #[test]
    fn case_and_foreign_folders_are_forgiven_with_a_finding() {
        let folder = Folder::new("case");
        std::fs::write(folder.0.join("asset/brick.png"), "brick").unwrap();
        let root = folder.root(false);
        let job = Job::default();
        let (bytes, finding) = root.read_or_beside("Sub\\wood.png", 100, &job).unwrap();
        assert_eq!((&bytes[..], finding.unwrap().code), (&b"wood"[..], "file.case"));
        let (bytes, finding) = root.read_or_beside("C:\\Users\\me\\brick.png", 100, &job).unwrap();
        assert_eq!((&bytes[..], finding.unwrap().code), (&b"brick"[..], "file.elsewhere"));
        assert_eq!(root.read_or_beside("http://x/brick.png", 100, &job).unwrap_err().code, "file.url");
    }

    #[test]
    fn sizes_are_asked_before_reading() {
        let folder = Folder::new("sizes");
        let root = folder.root(false);
        let job = Job::builder().memory(3).build();
        assert_eq!(root.read("sub/Wood.PNG", 100, &job).unwrap_err().code, "job.memory");
        assert_eq!(root.read("sub/Wood.PNG", 3, &Job::default()).unwrap_err().code, "file.size");
    }

    #[test]
    fn percent_signs_are_decoded() {
        assert_eq!(percent_decoded("a%20b%2Fc").as_deref(), Some("a b/c"));
        assert_eq!(percent_decoded("100%").as_deref(), Some("100%"));
        assert_eq!(percent_decoded("%ff"), None);
    }

    #[test]
    fn parts_of_a_blob_stay_within_it() {
        let blob = Blob::from(&b"0123456789"[..]);
        let part = blob.slice(2, 4).unwrap();
        let mut out = [0; 2];
        part.read_at(2, &mut out).unwrap();
        assert_eq!(&out, b"45");
        assert!(part.read_at(3, &mut out).is_err());
        assert!(part.read_at(u64::MAX, &mut out).is_err());
        assert!(blob.slice(u64::MAX, 2).is_none() && blob.slice(5, 6).is_none());
    }
}
