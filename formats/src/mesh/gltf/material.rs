//! Materials of glTF: metallic-roughness as diffuse and specular reflectance and an exponent.

use airlight_core::scene::Material;
use glam::Vec3;

use super::super::listed;
use super::Fault;
use super::json::{self, Root, TextureInfo};

/// kd = (1 - metallic) · base; ks = 0.04 + (base - 0.04) · metallic, the reflectance head-on; and, with α = roughness²,
/// n = (1/α² - 1) / 2: the lobe about the mirrored direction that is as wide as the distribution of normals
/// cos^(2/α² - 2), since a normal that turns by an angle turns what it mirrors by twice as much.
fn convert(pbr: &json::Pbr) -> Material {
    let [r, g, b, _] = pbr.base_color_factor;
    let base = Vec3::new(r as f32, g as f32, b as f32);
    let metallic = pbr.metallic_factor as f32;
    let alpha = pbr.roughness_factor.powi(2);
    let shininess = (0.5 * (1.0 / (alpha * alpha) - 1.0)).min(f64::from(Material::MAX_SHININESS));
    Material {
        diffuse: (1.0 - metallic) * base,
        specular: Vec3::splat(0.04).lerp(base, metallic).clamp(Vec3::ZERO, Vec3::ONE),
        shininess: shininess as f32,
    }
}

/// The materials of a document with their names, and what of them is not read.
pub(super) fn materials(root: &Root, warnings: &mut Vec<String>) -> Result<Vec<(String, Material)>, Fault> {
    let (mut pictures, mut clear, mut shining) = (Vec::new(), Vec::new(), Vec::new());
    let mut made = Vec::new();
    for (i, material) in root.materials.iter().enumerate() {
        let name = material.name.clone().unwrap_or_else(|| format!("material {i}"));
        let pbr = &material.pbr_metallic_roughness;
        let factors = [&pbr.base_color_factor[..], &[pbr.metallic_factor, pbr.roughness_factor]].concat();
        if let Some(odd) = factors.iter().find(|v| !(0.0..=1.0).contains(*v)) {
            let what = format!("a factor of pbrMetallicRoughness is {odd}; each must be from 0 to 1");
            return Err(Fault::At(format!("materials[{i}]"), what));
        }
        let textures = [
            &pbr.base_color_texture,
            &pbr.metallic_roughness_texture,
            &material.normal_texture,
            &material.occlusion_texture,
            &material.emissive_texture,
        ];
        pictures.extend(textures.into_iter().flatten().map(|t| picture(root, t)));
        if material.alpha_mode.as_deref().is_some_and(|mode| mode != "OPAQUE") {
            clear.push(name.clone());
        }
        if material.emissive_factor != [0.0; 3] {
            shining.push(name.clone());
        }
        made.push((name, convert(pbr)));
    }
    if !pictures.is_empty() {
        pictures.sort();
        pictures.dedup();
        warnings.push(format!("pictures on surfaces are not read, their factors are taken: {}", listed(&pictures)));
    }
    if !clear.is_empty() {
        warnings.push(format!("surfaces are opaque; transparency is left out: {}", listed(&clear)));
    }
    if !shining.is_empty() {
        warnings.push(format!("surfaces do not shine; emission is left out: {}", listed(&shining)));
    }
    Ok(made)
}

/// The name of a texture's picture.
fn picture(root: &Root, texture: &TextureInfo) -> String {
    let image = root.textures.get(texture.index).and_then(|t| t.source).and_then(|i| root.images.get(i));
    let uri = image.and_then(|i| i.uri.as_deref()).filter(|uri| !uri.starts_with("data:"));
    uri.or(image.and_then(|i| i.name.as_deref())).map_or_else(|| format!("texture {}", texture.index), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::gltf::json::Pbr;

    #[test]
    fn metal_and_roughness_become_reflectances_and_an_exponent() {
        let of = |base: [f64; 3], metallic_factor, roughness_factor| {
            let base_color_factor = [base[0], base[1], base[2], 1.0];
            convert(&Pbr { base_color_factor, metallic_factor, roughness_factor, ..Pbr::default() })
        };
        let near = |a: Vec3, b: Vec3| assert!((a - b).length() < 1e-6, "{a} {b}");
        let paint = of([0.8, 0.4, 0.2], 0.0, 0.5);
        near(paint.diffuse, Vec3::new(0.8, 0.4, 0.2));
        near(paint.specular, Vec3::splat(0.04));
        // α = ¼: (16 - 1) / 2.
        assert_eq!(paint.shininess, 7.5);
        let gold = of([1.0, 0.77, 0.34], 1.0, 1.0);
        near(gold.diffuse, Vec3::ZERO);
        near(gold.specular, Vec3::new(1.0, 0.77, 0.34));
        assert_eq!(gold.shininess, 0.0);
        assert_eq!(of([1.0; 3], 0.5, 0.0).shininess, Material::MAX_SHININESS);
        near(of([1.0; 3], 0.5, 0.0).specular, Vec3::splat(0.52));
    }
}
