//! What a file names must lie in its folder: a scene from a stranger does not get to read what else is on the disk.

use super::command::{Place, square};
use super::mutate;
use serde_json::json;

/// Ways out of the folder `house`, to the files beside it.
const WAYS_OUT: [&str; 10] = [
    "../secret.EXT",
    "./../secret.EXT",
    "in/../../secret.EXT",
    "%2e%2e/secret.EXT",
    "..%2Fsecret.EXT",
    "%2E%2E%5Csecret.EXT",
    "..\\secret.EXT",
    "in\\..\\..\\secret.EXT",
    "ROOT/secret.EXT",
    "link/secret.EXT",
];

/// A folder `house` with a scene in it, a folder `in`, a link out, and secrets beside it.
fn place() -> Place {
    let place = Place::new();
    let bytes = square(|_, _| ());
    let bin = mutate::split(&bytes).unwrap().bin.unwrap();
    place.write("secret.bin", &bin);
    place.write(
        "secret.hdr",
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x81\x80\x80\x80\x81",
    );
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(2, 2).write_to(&mut png, image::ImageFormat::Png).unwrap();
    place.write("secret.png", png.get_ref());
    place.write("house/in/own.txt", b"");
    #[cfg(unix)]
    std::os::unix::fs::symlink(place.folder.path(), place.folder.path().join("house/link")).unwrap();
    place
}

fn ways(place: &Place, extension: &str) -> Vec<String> {
    let root = place.folder.path().to_str().unwrap();
    WAYS_OUT.iter().map(|way| way.replace("ROOT", root).replace("EXT", extension)).collect()
}

fn bake(place: &Place, scene: &[u8], more: &str) -> super::command::Ended {
    place.write("house/scene.gltf", scene);
    place.run(&format!(
        "bake house/scene.gltf -o house/out.gltf --quality draft --page-size 32 --threads 1 {more}"
    ))
}

/// The square with its buffer, a texture and a sky behind the given uris.
fn scene(buffer: &str, image: &str, sky: Option<&str>) -> Vec<u8> {
    let bytes = square(|json, _| {
        json["buffers"] = json!([{"byteLength": 60, "uri": buffer}]);
        json["images"] = json!([{"uri": image}]);
        json["textures"] = json!([{"source": 0}]);
        json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
        json["meshes"][0]["primitives"][0]["material"] = json!(0);
        if let Some(sky) = sky {
            json["scenes"][0]["extras"]["lightkiln.sky"] = json!(sky);
        }
    });
    mutate::split(&bytes).unwrap().json.to_string().into_bytes()
}

#[test]
fn no_way_leads_out_of_the_folder_unless_it_is_allowed() {
    let place = place();
    for (name, extension) in [("secret.bin", "bin"), ("secret.png", "png"), ("secret.hdr", "hdr")] {
        let own = std::fs::read(place.folder.path().join(name)).unwrap();
        place.write(&format!("house/in/own.{extension}"), &own);
    }
    bake(&place, &scene("in/own.bin", "in/own.png", Some("in/own.hdr")), "").warned(&["wrote"]);
    for (buffer, (image, sky)) in
        ways(&place, "bin").iter().zip(ways(&place, "png").iter().zip(&ways(&place, "hdr")))
    {
        let words = ["--allow-outside"];
        bake(&place, &scene(buffer, "in/own.png", None), "").refused(&words);
        bake(&place, &scene("in/own.bin", image, None), "").refused(&words);
        bake(&place, &scene("in/own.bin", "in/own.png", Some(sky)), "").refused(&words);
        bake(&place, &scene(buffer, image, Some(sky)), "--allow-outside").warned(&["wrote"]);
    }
}

#[test]
fn devices_and_addresses_are_not_read_even_when_outside_is_allowed() {
    let place = place();
    for buffer in ["/dev/zero", "/dev/stdin", "..", ".", "http://127.0.0.1:9/x.bin", "file:///etc/passwd"] {
        bake(&place, &scene(buffer, "data:,", None), "--allow-outside").refused(&["buffer 0"]);
    }
    #[cfg(unix)]
    {
        let pipe = place.folder.path().join("house/pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        bake(&place, &scene("pipe", "data:,", None), "").refused(&["buffer 0", "regular file"]);
    }
}
