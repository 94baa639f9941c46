"""How do I add a scene to the simulator? A meadow with a shed, a pond, trees and a wire across it."""

# --8<-- [start:scene]
import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, rectangle
from sitl.world.primitives import Box, Kind, Wire
from sitl.world.world import World


def build(seed: int) -> Scene:
    """Return a meadow of 120 m; the seed moves relief and trees."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(60.0, 0.5, terrain_rng)
    terrain.swell(0.3, 40.0)
    terrain.level(terrain.rectangle(-10.0, -10.0, 10.0, 10.0), 0.0, 10.0)
    terrain.flood(terrain.ellipse(35.0, 0.0, 12.0, 8.0), terrain.at(35.0, 0.0) - 0.5, 4.0)
    shed = Box(-30.0, 20.0, terrain.at(-30.0, 20.0), 8.0, 5.0, 3.0, 0.3, Kind.WOOD, "shed")
    solids = [shed, Wire((-50.0, -30.0, 9.0), (50.0, -30.0, 9.0), name="wire")]
    for k, (x, y) in enumerate(rng.uniform((-50.0, 30.0), (50.0, 50.0), (12, 2))):
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(5.0, 9.0), rng)
    world = World(terrain.ground(), solids)
    middle = rectangle(-10.0, -10.0, 10.0, 10.0)
    return Scene("meadow", seed, world, (0.0, 0.0, 0.0), "Meadow with a shed and a pond", {"middle": middle})


# --8<-- [end:scene]
if __name__ == "__main__":
    import matplotlib.pyplot as plt

    from sitl.truth import truth

    scene = build(seed=1)
    found = truth.safe_map(scene.world, (-40.0, -40.0, 50.0, 40.0))  # west, south, east, north
    print(f"{scene.name}: {100 * float(found.safe.mean()):.0f} % of it is safe for a footprint of 2 m")
    plt.figure(figsize=(4.5, 4), layout="constrained")
    plt.imshow(found.safe, origin="lower", extent=(-40, 50, -40, 40), cmap="RdYlGn")
    plt.savefig("own_scene.png", dpi=72)
