//! Materials: what diffuse light needs of glTF's metallic-roughness model and its extensions.

use super::document::Document;
use super::images::{Space, Ticket, Wanted};
use super::json::{MATERIALS, Part, items};
use crate::error::{Error, Result, Warning};
use crate::options::ImportOptions;
use crate::scene::{Alpha, Material, Texture, TextureSlot};
use crate::units::{Radiance, Reflectance};
use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use gltf::json::material::AlphaMode;
use gltf::json::texture::Info;
use gltf::json::validation::Checked;
use serde_json::Value;

/// Reads the materials: index 0 is the default one, glTF's own follow. Only those in `used` are looked at; the others
/// keep their place and name.
pub(super) fn read(
    document: &Document,
    used: &[bool],
    options: &ImportOptions,
    warnings: &mut Vec<Warning>,
) -> Result<(Vec<Material>, Vec<Texture>)> {
    let mut wanted = Wanted::new(document);
    let mut drafts = Vec::new();
    for index in 0..items(&document.json, MATERIALS)?.len() {
        let is_used = used.get(index + 1).copied().unwrap_or(false);
        drafts.push(if is_used {
            Draft::read(&Part::item(&document.json, MATERIALS, index)?, &mut wanted, warnings)?
        } else {
            Draft::unused(&document.json, index)
        });
    }
    let decoded = wanted.decode(options)?;
    let mut materials = vec![Material::default()];
    for draft in drafts {
        let Draft { mut material, slots } = draft;
        let mut redeem = |slot: Option<Slot>| {
            let slot = slot?;
            let found = slot.ticket.as_ref().map_err(String::as_str).and_then(|ticket| decoded.get(*ticket));
            match found {
                Ok(texture) => {
                    Some(TextureSlot { texture, texcoord: slot.texcoord, transform: slot.transform })
                }
                Err(what) => {
                    let what =
                        format!("its {} texture is left out and its factor used alone: {what}", slot.role);
                    warnings.push(Warning::new(material.name.clone(), what));
                    None
                }
            }
        };
        let [base_color, metallic, emission] = slots.map(&mut redeem);
        material.base_color_texture = base_color;
        material.metallic_texture = metallic;
        material.emission_texture = emission;
        materials.push(material);
    }
    Ok((materials, decoded.textures))
}

/// A texture as a material wants it.
struct Slot {
    role: &'static str,
    ticket: std::result::Result<Ticket, String>,
    texcoord: usize,
    transform: Affine2,
}

/// A material whose textures are not decoded yet: base colour, metallic, emission.
struct Draft {
    material: Material,
    slots: [Option<Slot>; 3],
}

impl Draft {
    fn unused(json: &Value, index: usize) -> Self {
        let name =
            Part::item(json, MATERIALS, index).map_or_else(|_| format!("material {index}"), |m| m.label());
        let material = Material { name, index: Some(index), ..Material::default() };
        Self { material, slots: [None, None, None] }
    }

    fn read(part: &Part, wanted: &mut Wanted, warnings: &mut Vec<Warning>) -> Result<Self> {
        let broken = |error| Error::invalid(part.at(), format!("{error}: export the scene again"));
        let typed: gltf::json::Material =
            serde_json::from_value(Value::Object(part.object.clone())).map_err(broken)?;
        let mut clamp = Clamp { part, warnings };
        let pbr = &typed.pbr_metallic_roughness;
        let extensions = typed.extensions.as_ref();

        let gloss = extensions.and_then(|e| e.pbr_specular_glossiness.as_ref());
        let (color, color_info, metallic, metallic_info) = match gloss {
            // Its specular part is not diffuse light, and its diffuse part is no metal.
            Some(gloss) => (gloss.diffuse_factor.0, gloss.diffuse_texture.as_ref(), 0.0, None),
            None => (
                pbr.base_color_factor.0,
                pbr.base_color_texture.as_ref(),
                pbr.metallic_factor.0,
                pbr.metallic_roughness_texture.as_ref(),
            ),
        };
        let base_color = clamp.at_least_zero("base colour", Vec4::from_array(color))?;
        let metallic = clamp.fraction("metallic", metallic)?;
        let transmission = extensions.and_then(|e| e.transmission.as_ref());
        let transmission =
            clamp.fraction("transmission", transmission.map_or(0.0, |t| t.transmission_factor.0))?;
        let strength = extensions.and_then(|e| e.emissive_strength.as_ref());
        let strength =
            clamp.at_least_zero("emissive strength", strength.map_or(1.0, |s| s.emissive_strength.0))?;
        let factor = clamp.at_least_zero("emission", Vec3::from_array(typed.emissive_factor.0))?;
        let emission = clamp.at_least_zero("emission", factor * strength)?;
        let alpha = match typed.alpha_mode {
            Checked::Valid(AlphaMode::Opaque) => Alpha::Opaque,
            Checked::Valid(AlphaMode::Blend) => Alpha::Blend,
            Checked::Valid(AlphaMode::Mask) => {
                let cutoff = typed.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
                Alpha::Mask { cutoff: clamp.at_least_zero("alpha cutoff", cutoff)? }
            }
            Checked::Invalid => return Err(part.wrong("alphaMode", "must be OPAQUE, MASK or BLEND")),
        };
        let material = Material {
            name: part.label(),
            index: Some(part.position()),
            base_color,
            metallic,
            transmission,
            emission: Radiance(emission),
            alpha,
            double_sided: typed.double_sided,
            unlit: extensions.is_some_and(|e| e.unlit.is_some()),
            ..Material::default()
        };
        warn_of_reflectance(part, &material, color_info.is_some(), metallic_info.is_some(), warnings)?;

        // Textures that cannot change the result are not decoded.
        let shows_color = !material.unlit || alpha != Alpha::Opaque;
        let mut slot = |role, info: Option<&Info>, space, is_seen: bool| match info.filter(|_| is_seen) {
            None => Ok(None),
            Some(info) => slot(part, role, info, space, wanted).map(Some),
        };
        let slots = [
            slot("base colour", color_info, Space::Srgb, shows_color)?,
            slot("metallic", metallic_info, Space::Linear, metallic > 0.0 && !material.unlit)?,
            slot("emissive", typed.emissive_texture.as_ref(), Space::Srgb, material.emits())?,
        ];
        Ok(Self { material, slots })
    }
}

fn slot(part: &Part, role: &'static str, info: &Info, space: Space, wanted: &mut Wanted) -> Result<Slot> {
    let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
    let texcoord = transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord) as usize;
    let transform = match transform {
        None => Affine2::IDENTITY,
        Some(t) => uv_transform(Vec2::from_array(t.offset.0), t.rotation.0, Vec2::from_array(t.scale.0)),
    };
    if !transform.is_finite() {
        return Err(part.wrong("KHR_texture_transform", "must hold finite numbers"));
    }
    let ticket = wanted.ask(info.index.value(), space, part)?;
    Ok(Slot { role, ticket, texcoord, transform })
}

/// uv′ = T·R·S·uv. R turns the image clockwise as it is seen; because v runs down, that is (cos, sin; −sin, cos).
fn uv_transform(offset: Vec2, rotation_rad: f32, scale: Vec2) -> Affine2 {
    Affine2::from_mat2_translation(Mat2::from_angle(-rotation_rad) * Mat2::from_diagonal(scale), offset)
}

/// Says where light would never fade, or never be reflected although the artist probably wants it.
fn warn_of_reflectance(
    part: &Part,
    material: &Material,
    has_color_texture: bool,
    has_metallic_texture: bool,
    warnings: &mut Vec<Warning>,
) -> Result<()> {
    if material.unlit {
        return Ok(());
    }
    let color = material.base_color.truncate();
    let share =
        if has_metallic_texture { 1.0 } else { 1.0 - material.metallic } * (1.0 - material.transmission);
    let brightest = (color * share).max_element();
    if brightest > Reflectance::MAX && (!has_color_texture || brightest > 1.0) {
        let what = format!(
            "base colour {brightest}: light would never fade in a closed room; {} is used, real white paint has 0.8",
            Reflectance::MAX
        );
        warnings.push(Warning::new(material.name.clone(), what));
    }
    let pbr = part.object("pbrMetallicRoughness")?;
    let says_metallic = pbr.is_some_and(|pbr| pbr.object.contains_key("metallicFactor"));
    if material.metallic == 1.0 && !says_metallic && !has_metallic_texture && !material.emits() {
        let what = "it does not say how metallic it is, and glTF then means wholly: it reflects no diffuse light; set \
                    metallic to 0 if it is no metal";
        warnings.push(Warning::new(material.name.clone(), what));
    }
    Ok(())
}

/// Brings factors into range, by name.
struct Clamp<'a> {
    part: &'a Part<'a>,
    warnings: &'a mut Vec<Warning>,
}

impl Clamp<'_> {
    fn warn(&mut self, name: &str) {
        self.warnings
            .push(Warning::new(self.part.label(), format!("its {name} is out of range and is clamped")));
    }

    fn at_least_zero<T: Factor>(&mut self, name: &str, value: T) -> Result<T> {
        if !value.is_finite() {
            return Err(Error::invalid(self.part.at(), format!("its {name} is not a finite number")));
        }
        let lawful = value.max_zero();
        if lawful != value {
            self.warn(name);
        }
        Ok(lawful)
    }

    fn fraction(&mut self, name: &str, value: f32) -> Result<f32> {
        let lawful = self.at_least_zero(name, value)?;
        if lawful > 1.0 {
            self.warn(name);
        }
        Ok(lawful.min(1.0))
    }
}

/// What can be clamped at zero.
trait Factor: Copy + PartialEq {
    fn is_finite(self) -> bool;
    fn max_zero(self) -> Self;
}

macro_rules! factor {
    ($type:ty, $zero:expr) => {
        impl Factor for $type {
            fn is_finite(self) -> bool {
                <$type>::is_finite(self)
            }
            fn max_zero(self) -> Self {
                self.max($zero)
            }
        }
    };
}

factor!(f32, 0.0);
factor!(Vec3, Vec3::ZERO);
factor!(Vec4, Vec4::ZERO);
