//! The rare filters, one lane at a time.

use super::fetch::{self, Listen, Store};
use super::map::{Footprint, Map};
use crate::math::vec::{Vec2, Vec4};

/// Any filter and wrap.
pub(super) fn look<S: Store, H: Listen>(
    m: &Map,
    texels: &[S],
    place: Vec2,
    _f: Footprint<f32>,
    listen: &mut H,
) -> Vec4 {
    let p = Vec2::new(fetch::fold(m.wrap[0], place.x), fetch::fold(m.wrap[1], place.y));
    S::finish(fetch::bilinear_border(texels, fetch::mip(&m.pyramid, 0.0), m.wrap, p, 1.0, listen))
}
