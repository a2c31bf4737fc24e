//! The built-in scenes, all made by code.

use crate::scene::Scene;

/// The names and what they show.
pub const NAMES: &[(&str, &str)] = &[("frieze", "the showpiece: a carved stone relief")];

/// The built-in scene called `name`.
pub fn scene(name: &str) -> Option<Scene> {
    (name == "frieze").then(|| Scene { name: name.into(), ..Scene::default() })
}
