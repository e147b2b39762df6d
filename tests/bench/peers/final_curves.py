"""Error over time of one-bounce indirect light: chiaro's final_gather, Blender's Cycles, and Cycles denoised.

    python final_curves.py SCENE.glb REFERENCE.exr [--chiaro PATH] [--asked 2] [--runs 3] [--work DIR]

REFERENCE.exr: `Diffuse Indirect`, `Diffuse Color` and Cryptomatte of Blender, 640x480, one bounce. Errors are relative RMSE in
per cent: over blocks of 4x4 pixels of one object, and pixel by pixel. Seconds are medians, without loading the scene. The
programs take turns, since machines drift. Needs `bpy` (PyPI), and `cargo build --release`.
"""

import argparse
import json
import math
import os
import re
import statistics
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
TOLERANCES = [0.2, 0.1, 0.05, 0.03, 0.02, 0.015, 0.01]
SAMPLES = [1, 4, 16, 64, 256]
INDIRECT, COLOUR = "Diffuse Indirect", "Diffuse Color"


def said(command):
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode:
        sys.exit(f"{' '.join(command)}\n{result.stdout}\n{result.stderr}")
    return result.stdout


def chiaro(arguments, tolerance):
    """Seconds, picture."""
    file = os.path.join(arguments.work, f"chiaro-{tolerance}.exr")
    report = os.path.join(arguments.work, "report.json")
    nodes = {
        "stage": {"type": "scene", "params": {"file": os.path.abspath(arguments.scene)}},
        "final": {
            "type": "final_gather",
            "params": {"width": 640, "height": 480, "samples_per_pixel": 1, "bounces": 1, "tolerance": tolerance},
            "inputs": {"scene": "stage"},
        },
        "out": {"type": "write_image", "params": {"file": file, "depth": "float"}, "inputs": {"image": "final"}},
    }
    recipe = os.path.join(arguments.work, "recipe.json")
    with open(recipe, "w") as out:
        json.dump({"chiaro": 1, "nodes": nodes}, out)
    fixed = ["--no-cache", "--device", "cpu", "--progress", "none"]
    said([arguments.chiaro, "render", recipe, "--report", report, *fixed])
    with open(report) as text:
        seconds = next(node["seconds"] for node in json.load(text)["nodes"] if node["node"] == "final")
    return seconds, file + ":indirect"


def cycles(arguments, samples, denoised):
    """Seconds, picture."""
    script = os.path.join(HERE, "blender_cycles.py")
    out = os.path.join(arguments.work, "denoised" if denoised else "plain")
    more = ["--denoise"] if denoised else []
    text = said([sys.executable, script, arguments.scene, out, "--samples", str(samples), *more])
    found = json.loads(next(line for line in text.splitlines() if line.startswith("{")))
    return found["seconds"], found["file"] + (":Composite.Combined" if denoised else f":{INDIRECT}")


def errors(arguments, picture):
    """Relative RMSE in per cent: blocks, pixels."""
    times = [f"B:{COLOUR}"] + ([f"A:{COLOUR}"] if picture.endswith(INDIRECT) else [])
    command = [arguments.chiaro, "diff", picture, f"{arguments.reference}:{INDIRECT}", "--max-rmse", "1000"]
    for layer in times:
        command += ["--times", layer]
    found = []
    for size in ("4", "1"):
        text = said([*command, "--blocks", size, "--objects", arguments.reference])
        found.append(float(re.search(r"all objects\s+\d+\s+([\d.]+) %", text).group(1)))
    return found


def time_at(curve, asked):
    """Seconds to an error, between the two points around it or along the slope of the last two; and whether it was met."""
    points = [(math.log(seconds), math.log(error)) for seconds, error in curve]
    for (a, e), (b, f) in zip(points, points[1:]):
        if f <= math.log(asked) <= e:
            return math.exp(a + (b - a) * (e - math.log(asked)) / max(e - f, 1e-9)), True
    if points[0][1] <= math.log(asked):
        return math.exp(points[0][0]), True
    (a, e), (b, f) = points[-2:]
    return (math.exp(b + (b - a) * (f - math.log(asked)) / (e - f)) if e > f else math.inf), False


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("reference")
    parser.add_argument("--chiaro", default=os.path.join(HERE, "../../../target/release/chiaro"))
    parser.add_argument("--asked", type=float, default=2.0, help="error in per cent that times are compared at")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--work", default=None)
    arguments = parser.parse_args()
    arguments.work = arguments.work or tempfile.mkdtemp()
    os.makedirs(arguments.work, exist_ok=True)
    programs = {
        "chiaro final_gather": (TOLERANCES, "tolerance", lambda value: chiaro(arguments, value)),
        "Cycles": (SAMPLES, "samples", lambda value: cycles(arguments, value, False)),
        "Cycles, denoised": (SAMPLES, "samples", lambda value: cycles(arguments, value, True)),
    }
    seconds, found = {}, {}
    for _ in range(arguments.runs):
        for name, (settings, _, render) in programs.items():
            for setting in settings:
                time, picture = render(setting)
                seconds.setdefault((name, setting), []).append(time)
                if (name, setting) not in found:
                    found[name, setting] = errors(arguments, picture)
    print(f"{'':<22}{'setting':>18}{'seconds':>10}{'blocks %':>10}{'pixels %':>10}")
    at = {}
    for name, (settings, word, _) in programs.items():
        curve = []
        for setting in settings:
            time, (blocks, pixels) = statistics.median(seconds[name, setting]), found[name, setting]
            curve.append((time, blocks))
            print(f"{name:<22}{f'{word} {setting}':>18}{time:>10.2f}{blocks:>10.2f}{pixels:>10.2f}")
        at[name] = time_at(curve, arguments.asked)
    ours = at["chiaro final_gather"][0]
    for name, (time, met) in at.items():
        how = "" if met else f" (not reached; the last point has {found[name, programs[name][0][-1]][0]:.2f} %)"
        print(f"{name}: {time:.1f} s to {arguments.asked} % over blocks{how}, {time / ours:.1f} times chiaro's")


main()
