//! The showpiece.
use super::*;
pub(super) fn scene() -> Scene {
    super::teapot()
}
