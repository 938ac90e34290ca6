//! `[camera]`.

use airlight_core::scene::Camera;
use glam::DVec3;

use super::error::Fault;
use super::table::{Field, Table};

const KEYS: &[&str] = &["origin", "target", "up", "fov", "size", "samples"];

pub(super) fn parse(root: &Table<'_>) -> Result<Camera, Fault> {
    let camera = root.require("camera", "[camera] with origin = [0, 0, 3] and target = [0, 0, 0]")?.table(KEYS)?;
    let (width, height) = camera.or("size", (512, 512), |f| size(&f))?;
    Ok(Camera {
        origin: camera.require("origin", "origin = [0, 0, 3]")?.vector()?,
        target: camera.require("target", "target = [0, 0, 0]")?.vector()?,
        up: camera.or("up", DVec3::Y, |f| f.vector())?,
        fov: camera.or("fov", 40.0, |f| f.number_where("above 0 and below 180 degrees", |v| v > 0.0 && v < 180.0))?,
        width,
        height,
        samples: camera.or("samples", 1, |f| f.whole(1..=Camera::MAX_SAMPLES))?,
    })
}

fn size(field: &Field<'_>) -> Result<(u32, u32), Fault> {
    match &field.list()?[..] {
        [width, height] => Ok((width.whole(1..=Camera::MAX_SIDE)?, height.whole(1..=Camera::MAX_SIDE)?)),
        _ => Err(field.wrong("it must be [width, height]")),
    }
}
