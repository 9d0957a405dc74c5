"""The same texture space baked by Cycles, and how far lightkiln's light is from it."""

import bpy
import numpy as np

import pictures

# Agreement that is asked for: of the means, and of the texels.
MEAN_RATIO = 0.01
MEDIAN_ERROR = 0.03
# Where the texels differ by more while Cycles' own noise is above this, it may be the noise: then it is given twice the samples
# and asked again, so many times at the most. What noise is left then is averaged over square blocks of texels, in which an
# error of ours stays. (Few samples are far from a normal distribution, so the noise cannot be taken off the error as a square.)
MOST_NOISE = 0.015
MOST_DOUBLINGS = 3
BLOCKS = (1, 2, 4)
# Fewer blocks than this have no median worth the name.
FEWEST_BLOCKS = 50


def bake(baked, pages, owners, samples):
    """Bakes the lightmap set of an imported baked file with the lamps and the world of the scene that is open.

    The scene that is open is the original: its lamps and world stay, its shapes give way to the baked file's, which has
    the coordinates. Returns file -> two pages [rows from the top, columns, 3] of independent noise, E/pi as lightkiln's,
    and how many samples they took together: at least `samples`, more where they do not tell noise from error.
    """
    keep_light_only()
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(baked))
    for thing in [thing for thing in bpy.data.objects if thing not in before and thing.type == "LIGHT"]:
        bpy.data.objects.remove(thing)
    imported = [thing for thing in bpy.data.objects if thing not in before]
    lit = [thing for thing in imported if thing.type == "MESH" and hasattr(thing.get("lightmap"), "to_dict")]
    images = {}
    for thing in lit:
        entry = thing["lightmap"].to_dict()
        file = entry["file"]
        if file not in images:
            width, height = pages[file].shape[1::-1]
            images[file] = bpy.data.images.new(file, width, height, float_buffer=True, is_data=True)
        thing.data.uv_layers.active_index = entry["texCoord"]
        if not thing.data.materials:
            thing.data.materials.append(bpy.data.materials.new("none"))
        for slot in thing.material_slots:
            aim_at(slot.material, images[file])
    for made in bpy.data.materials:
        make_matte(made)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    settings = scene.cycles
    settings.use_adaptive_sampling, settings.use_denoising = False, False
    settings.max_bounces = settings.diffuse_bounces = settings.transparent_max_bounces = 64
    # What makes other pictures smoother makes these ones wrong.
    settings.sample_clamp_direct = settings.sample_clamp_indirect = settings.light_sampling_threshold = 0
    for thing in bpy.data.objects:
        thing.select_set(thing in lit)
    bpy.context.view_layer.objects.active = lit[0]
    halves, taken, seed = None, 0, 0
    for doubling in range(MOST_DOUBLINGS + 1):
        settings.samples = max(samples // 2, 1) if halves is None else taken
        new = [one_pass(images, seed + half) for half in (0, 1)]
        seed += 2
        if halves is None:
            halves = new
        else:
            # As many samples as there were already: the mean of the two has all of them.
            halves = [{file: (old[file] + more[file]) / 2 for file in images} for old, more in zip(halves, new)]
        taken += settings.samples
        if not any(undecided(compare(pages[file], [half[file] for half in halves], owners[file], blocks=(1,))[0]) for file in images):
            break
    return {file: (halves[0][file], halves[1][file]) for file in images}, 2 * taken


def one_pass(images, seed):
    """One bake of all pages."""
    bpy.context.scene.cycles.seed = seed
    for image in images.values():
        image.pixels.foreach_set(np.zeros(len(image.pixels), np.float32))
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT"}, margin=0, use_clear=True)
    return {file: pixels_of(image) for file, image in images.items()}


def keep_light_only():
    """Lamps stay where they are in the world; everything else goes."""
    lamps = [thing for thing in bpy.context.scene.objects if thing.type == "LIGHT"]
    places = {lamp: lamp.matrix_world.copy() for lamp in lamps}
    for lamp in lamps:
        lamp.parent = None
        lamp.matrix_world = places[lamp]
    for thing in [thing for thing in bpy.data.objects if thing.type != "LIGHT"]:
        bpy.data.objects.remove(thing)


def aim_at(material, image):
    material.use_nodes = True
    nodes = material.node_tree.nodes
    target = nodes.new("ShaderNodeTexImage")
    target.image = image
    for node in nodes:
        node.select = node == target
    nodes.active = target


def make_matte(material):
    """The diffuse world that is baked: no specular lobe above it, and backs of single-sided surfaces that only block."""
    if not material.node_tree:
        return
    nodes, links = material.node_tree.nodes, material.node_tree.links
    for node in [node for node in nodes if node.type == "BSDF_PRINCIPLED"]:
        node.inputs["Specular IOR Level"].default_value = 0.0
        node.inputs["Roughness"].default_value = 1.0
        if not material.use_backface_culling:
            continue
        geometry, front = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeMath")
        front.operation, front.inputs[0].default_value = "SUBTRACT", 1.0
        links.new(geometry.outputs["Backfacing"], front.inputs[1])
        for name in ("Base Color", "Emission Color"):
            product = nodes.new("ShaderNodeVectorMath")
            product.operation = "MULTIPLY"
            socket = node.inputs[name]
            if socket.is_linked:
                links.new(socket.links[0].from_socket, product.inputs[0])
            else:
                product.inputs[0].default_value = list(socket.default_value)[:3]
            links.new(front.outputs[0], product.inputs[1])
            links.new(product.outputs["Vector"], socket)


def pixels_of(image):
    width, height = image.size
    flat = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(flat)
    return flat.reshape(height, width, -1)[::-1, :, :3].astype(np.float64)


def interior(owner):
    """Texels whose eight neighbours belong to the same object: borders are sampled at other places by Cycles."""
    inside = owner >= 0
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            inside &= np.roll(owner, (dy, dx), axis=(0, 1)) == owner
    inside[[0, -1], :] = inside[:, [0, -1]] = False
    return inside


def lit_texels(theirs, owner):
    """Texels to compare, and those that are black to the last sample: inside of something, where lightkiln fills in
    what is around."""
    where = interior(owner)
    buried = where & (theirs.max(axis=-1) == 0)
    return where & ~buried, buried


def relative(difference, theirs):
    """Dark texels would divide noise by nothing."""
    return np.abs(difference) / np.maximum(theirs, 0.02 * theirs.mean())


def block_means(image, where, owner, block):
    """Means over the blocks that lie in `where` and on one object wholly."""
    rows, columns = (side // block * block for side in where.shape)

    def tiled(values):
        tiles = values[:rows, :columns].reshape(rows // block, block, columns // block, block)
        return tiles.swapaxes(1, 2).reshape(-1, block * block)

    owners = tiled(owner)
    whole = tiled(where).all(axis=1) & (owners == owners[:, :1]).all(axis=1)
    return tiled(image.mean(axis=-1))[whole].mean(axis=1)


def compare(ours, halves, owner, blocks=BLOCKS):
    """Numbers for one page, over the smallest blocks that tell noise from error. `owner` is the object at each texel, -1
    where there is none."""
    theirs = (halves[0] + halves[1]) / 2
    where, buried = lit_texels(theirs, owner)
    a, b = (side.mean(axis=-1)[where] for side in (ours, theirs))
    if not len(a) or b.mean() == 0:
        # No light at all is an answer too, when both give it.
        lit = ours[interior(owner)].any() if interior(owner).any() else True
        return {"texels": 0, "problems": ["nothing to compare"] if lit else []}, where
    facts = {"texels": int(where.sum()), "buried": int(buried.sum()), "mean ratio": float(a.mean() / b.mean())}
    for block in blocks:
        a, b, c = (block_means(side, where, owner, block) for side in (ours, theirs, halves[0] - halves[1]))
        if block > 1 and len(a) < FEWEST_BLOCKS:
            break
        error = relative(a - b, b)
        facts |= {
            "block": block,
            "median error": float(np.median(error)),
            "95th percentile": float(np.percentile(error, 95)),
            # Half of what the halves differ by is the noise of their mean.
            "median noise of Cycles": float(np.median(relative(c / 2, b))),
        }
        if not undecided(facts):
            break
    problems = facts["problems"] = []
    if abs(facts["mean ratio"] - 1) > MEAN_RATIO:
        problems.append(f"the mean is {facts['mean ratio']:.4f} times that of Cycles")
    if facts["median error"] > MEDIAN_ERROR:
        noise = facts["median noise of Cycles"]
        problems.append(f"the median error is {facts['median error']:.2%}, Cycles' own noise {noise:.2%}")
    return facts, where


def undecided(facts):
    """Whether the error of a page is too large, but may be noise."""
    return facts.get("median error", 0) > MEDIAN_ERROR and facts["median noise of Cycles"] > MOST_NOISE


def save_picture(path, ours, halves, where):
    pictures.save(path, pictures.side_by_side(ours, (halves[0] + halves[1]) / 2, where))
