//! Which versions and extensions can be read, and what to do about the others.

use super::json::Part;
use crate::error::{Error, Result};
use serde_json::Value;

/// Extensions that may stand in `extensionsRequired`. Those that say nothing of shape, colour or light of a surface
/// are here too: the file keeps them, and the bake does not need them.
const READABLE: [&str; 16] = [
    "EXT_mesh_features",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_structural_metadata",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
];

/// Families whose members are all readable in that sense.
const READABLE_PREFIXES: [&str; 3] = ["KHR_materials_", "KHR_audio", "KHR_interactivity"];

/// Lightmaps of others: replaced or kept, never an obstacle.
const READABLE_LIGHTMAPS: [&str; 3] = ["MOZ_lightmap", "EXT_texture_exr", "MOZ_texture_rgbe"];

/// Refuses what cannot be read. `at` names the file.
pub(super) fn check(json: &Value, at: &str) -> Result<()> {
    check_version(json, at)?;
    let root = Part::root(json)?;
    let used = root.array("extensionsUsed")?.unwrap_or(&[]);
    let required = root.array("extensionsRequired")?.unwrap_or(&[]);
    if used.iter().chain(required).any(|name| !name.is_string()) {
        return Err(Error::invalid(
            at,
            "its lists of extensions hold something that is not a name: export the scene again",
        ));
    }
    for name in required.iter().filter_map(Value::as_str) {
        if !is_readable(name) {
            return Err(Error::unsupported(
                at,
                format!("it requires {name}, which is not supported: {}", remedy(name)),
            ));
        }
    }
    Ok(())
}

fn is_readable(name: &str) -> bool {
    READABLE.contains(&name)
        || READABLE_LIGHTMAPS.contains(&name)
        || READABLE_PREFIXES.iter().any(|prefix| name.starts_with(prefix))
}

fn remedy(name: &str) -> &'static str {
    if name.contains("compression") {
        "export the scene again without compression"
    } else if name.contains("texture") || name.contains("image") {
        "export the scene again with PNG, JPEG or WebP textures"
    } else if name.contains("light") || name.contains("environment") {
        "export the lights as KHR_lights_punctual, and give the sky with --sky"
    } else {
        "export the scene again with that feature switched off, or remove it from extensionsRequired if the shapes and \
         materials do not depend on it"
    }
}

fn check_version(json: &Value, at: &str) -> Result<()> {
    let Some(asset) = Part::root(json)?.object("asset")? else {
        return Err(Error::invalid(at, "it has no \"asset\" and so is no glTF 2.0: export the scene again"));
    };
    let parse = |text: &str| {
        let (major, minor) = text.split_once('.')?;
        Some((major.parse::<u32>().ok()?, minor.parse::<u32>().ok()?))
    };
    let version = asset.text("version")?.unwrap_or_default();
    let Some((major, _)) = parse(version) else {
        return Err(Error::invalid(
            at,
            format!("its version '{version}' is not of the form 2.0: export the scene again"),
        ));
    };
    if major != 2 {
        let what = format!(
            "it is glTF {version}; only glTF 2 is read. Open it in Blender and export it as glTF 2.0"
        );
        return Err(Error::unsupported(at, what));
    }
    if let Some(text) = asset.text("minVersion")? {
        let Some(minimum) = parse(text) else {
            return Err(Error::invalid(
                at,
                format!("its minVersion '{text}' is not of the form 2.0: export the scene again"),
            ));
        };
        if minimum > (2, 0) {
            return Err(Error::unsupported(
                at,
                format!("it needs a reader of glTF {text}; this one reads 2.0: export the scene as that"),
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn reads_known_extensions_and_names_unknown_ones() {
        let file = |names: &[&str]| json!({"asset": {"version": "2.0"}, "extensionsRequired": names});
        assert!(check(&file(&["KHR_texture_transform", "KHR_materials_ior"]), "a.glb").is_ok());
        let error = check(&file(&["KHR_mesh_quantization", "VENDOR_strange"]), "a.glb").unwrap_err();
        assert!(matches!(&error, Error::Unsupported { .. }) && error.to_string().contains("VENDOR_strange"));
        assert!(check(&json!({"asset": {"version": "2.0"}, "extensionsUsed": [3]}), "a.glb").is_err());
    }

    #[test]
    fn refuses_other_versions() {
        let version = |asset: Value| check(&json!({ "asset": asset }), "a.glb");
        assert!(version(json!({"version": "2.1"})).is_ok());
        assert!(matches!(version(json!({"version": "1.0"})), Err(Error::Unsupported { .. })));
        assert!(matches!(
            version(json!({"version": "2.1", "minVersion": "2.1"})),
            Err(Error::Unsupported { .. })
        ));
        for bad in [json!({"version": "2"}), json!({"version": 2.0}), json!({}), json!("2.0")] {
            assert!(matches!(version(bad.clone()), Err(Error::Invalid { .. })), "{bad}");
        }
        assert!(check(&json!({}), "a.glb").is_err());
    }
}
