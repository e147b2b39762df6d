"""A Mitsuba integrator: direct light, one bounce of indirect light by final gathering, and chiaro's sampled edits in it.

    mi.set_variant("scalar_rgb")
    import edited_gather
    integrator = edited_gather.EditedGather(scene, edits, rays=64)

The picture is the beauty; the channels `indirect.R` ... hold the (edited) indirect part of it alone, W/(sr m²).
"""

import mitsuba as mi
import numpy as np


class EditedGather(mi.SamplingIntegrator):
    """scene: `gltf_scene.Scene`. edits: `chiaro_edits.Edits`, or None. rays: of one gather, rounded down to a square."""

    def __init__(self, scene, edits, rays):
        super().__init__(mi.Properties())
        self.edits, self.side = edits, max(int(rays**0.5), 1)
        self.first, self.objects = scene.first, scene.objects

    def prepare_edits(self, scene):
        """What offset rows add is known once the exitance of all gather samples is."""
        if self.edits is None or self.edits.offsets is None:
            return
        sections = self.edits.sections
        pairs = zip(sections["gather.position"].tolist(), sections["gather.normal"].tolist(), sections["gather.side"])
        exitance = np.array([self.leaving(scene, self.onto(scene, *pair)) for pair in pairs])
        self.edits.light_offsets(self.edits.at_source(np.arange(len(exitance)), exitance))

    def onto(self, scene, place, normal, side):
        """The surface at a place, as a ray from a little above it meets it."""
        normal = mi.Vector3f(normal)
        above = mi.Point3f(place) + normal * (1e-4 * self.edits.size)
        return scene.ray_intersect(mi.Ray3f(above, -normal))

    def aov_names(self):
        return ["indirect.R", "indirect.G", "indirect.B"]

    def sample(self, scene, sampler, ray, medium=None, active=True):
        si = scene.ray_intersect(ray)
        if not si.is_valid():
            return mi.Color3f(0), False, [0.0, 0.0, 0.0]
        direct = mi.Color3f(self.leaving(scene, si)) / np.pi
        indirect = self.gathered(scene, sampler, si)
        return direct + mi.Color3f(indirect), True, indirect.tolist()

    def leaving(self, scene, si):
        """Exitance of a diffuse surface by direct light, W/m²; [r, g, b]."""
        context, total = mi.BSDFContext(), mi.Color3f(0)
        if not si.is_valid():
            return [0.0, 0.0, 0.0]
        for emitter in scene.emitters():
            ds, weight = emitter.sample_direction(si, mi.Point2f(0.5))
            local = si.to_local(ds.d)
            if max(weight) > 0 and not scene.ray_test(si.spawn_ray_to(ds.p)):
                total += weight * si.bsdf().eval(context, si, local)
        return [np.pi * c for c in total]

    def gathered(self, scene, sampler, si):
        """Indirect radiance from a surface to the camera, W/(sr m²); array of 3."""
        colour = np.array(si.bsdf().eval_diffuse_reflectance(si))
        facing = 1.0 if si.wi.z >= 0 else -1.0
        normal = np.array(si.sh_frame.n) * facing
        flat = si.n * (1.0 if np.dot(si.n, normal) >= 0 else -1.0)
        light, places, normals, objects = [], [], [], []
        for i in range(self.side):
            for j in range(self.side):
                # Strata of equal cosine-weighted solid angle.
                at = (mi.Point2f(i, j) + sampler.next_2d()) / self.side
                local = mi.warp.square_to_cosine_hemisphere(at)
                direction = si.sh_frame.to_world(local * mi.Vector3f(1, 1, facing))
                if sum(direction * flat) <= 0:
                    continue
                hit = scene.ray_intersect(si.spawn_ray(direction))
                if not hit.is_valid():
                    continue
                leaving = self.leaving(scene, hit)
                light.append(leaving)
                if self.edits is not None:
                    places.append(list(hit.p))
                    normals.append(list(hit.n * (1.0 if sum(hit.n * direction) <= 0 else -1.0)))
                    objects.append(self.object(hit))
        light = np.array(light).reshape(-1, 3)
        if self.edits is None:
            return colour / np.pi * light.sum(axis=0) / self.side**2
        return self.edited(si, normal, colour, light, (objects, places, normals))

    def edited(self, si, normal, colour, light, hits):
        edits, added = self.edits, np.zeros(3)
        near, shares = edits.nearest_view(self.object(si), np.array(si.p), normal)
        mix = edits.rows(near, shares)
        # Light that no edit touches needs no look at where it comes from.
        if len(light) and (mix or edits.changes_source):
            objects, places, normals = map(np.array, hits)
            samples = edits.nearest_gather(objects, places, normals)
            light = edits.at_source(samples, light) * edits.scale(mix, samples)
        irradiance = light.sum(axis=0) / self.side**2 + edits.offset(mix)
        return edits.at_eye(near, shares, colour / np.pi * irradiance)

    def object(self, si):
        return int(self.objects[self.first[si.shape.id()] + si.prim_index])
