/* The renderer's settings: names, ranges, defaults. What a number means and where it comes from stands in gi.h. */
#include "gi/gi.h"
#include "gi/layer_light.h"
#include "gi/reflections/reflection_map.h"
#include "gi/screen/residual.h"
#include "platform/settings.h"

#define AT(field) offsetof(es_renderer_settings, field)

static const es_setting renderer_table[] = {
    {"width", ES_SETTING_INT, "1024", 1, ES_RASTER_MAX_SIZE, NULL, "pixels", AT(width)},
    {"height", ES_SETTING_INT, "768", 1, ES_RASTER_MAX_SIZE, NULL, "pixels", AT(height)},
    {"gi", ES_SETTING_CHOICE, "ism", 0, 0, "none|ism|classic|vpl-traced|vpl-sampled|micro|second-order",
        "indirect light: none, imperfect shadow maps, an accurate map per light, rays to every light, or to one a pixel; micro-buffers; second-order: lights without shadows and negative ones, which leaks light and sees no lobes", AT(method)},
    {"skip", ES_SETTING_BOOL, "true", 0, 1, NULL, "skip work whose result would be the same bits", AT(skip)},
    {"bounces", ES_SETTING_INT, "1", 0, ES_MAX_BOUNCES, NULL, "indirect bounces", AT(bounces)},
    {"bounce.method", ES_SETTING_CHOICE, "one-pass", 0, 0, "one-pass|reflective", "lights of bounces after the first: on points seen by shadow maps, or on texels of reflective maps", AT(bounce_method)},
    {"bounce.vpls", ES_SETTING_INT, "256", 0, 16384, NULL, "virtual point lights of each bounce after the first", AT(bounce_vpls)},
    {"bounce.points", ES_SETTING_INT, "256", 64, 65536, NULL, "bounce.method one-pass: points tried for each light that is reflected, a multiple of 64", AT(bounce_points)},
    {"bounce.rays", ES_SETTING_INT, "8", 0, 64, NULL, "bounce.method one-pass with shadow maps: rays for each light to what the maps show; 0: maps alone", AT(bounce_rays)},

    {"shadow.size", ES_SETTING_INT, "1024", 16, 8192, NULL, "texels of a shadow map's side", AT(shadow_size)},
    {"shadow.bias", ES_SETTING_FLOAT, "0.5", 0, 64, NULL, "constant depth bias, texels", AT(shadow_bias)},
    {"shadow.slope-bias", ES_SETTING_FLOAT, "1.0", 0, 64, NULL, "slope-scaled depth bias, shares of the filter's half width", AT(shadow_slope_bias)},
    {"shadow.filter", ES_SETTING_INT, "2", 1, 7, NULL, "percentage-closer filter, taps per side", AT(shadow_filter)},

    {"vpl.count", ES_SETTING_INT, "1024", 0, 16384, NULL, "virtual point lights per frame", AT(vpls)},
    {"vpl.light-size", ES_SETTING_INT, "256", 8, 2048, NULL, "texels of a light G-buffer's side, a power of two", AT(light_size)},
    {"vpl.seed", ES_SETTING_INT, "0", 0, 1000000, NULL, "offset into the Halton sequence", AT(seed)},
    {"vpl.bound", ES_SETTING_FLOAT, "16000", 0.01, 1e9, NULL, "largest geometry term cos cos / d², d as a share of the scene's extent", AT(geometry_bound)},
    {"vpl.spread", ES_SETTING_FLOAT, "2", 0, 100, NULL, "how far a light's own area softens it close by: 0 a point, 1 a disc", AT(spread)},
    {"vpl.near", ES_SETTING_FLOAT, "0", 0, 1, NULL,
        "nearer light is found by a ray per pixel, share of the scene's extent, in place of vpl.bound and vpl.spread; 0: none is", AT(near_distance)},
    {"vpl.view-importance", ES_SETTING_BOOL, "true", 0, 1, NULL, "more lights where they matter for what the camera sees", AT(view_importance)},
    {"vpl.stable", ES_SETTING_BOOL, "false", 0, 1, NULL, "lights keep their places between frames and follow their surface; no camera moves them", AT(stable_vpls)},
    {"vpl.renew", ES_SETTING_FLOAT, "0.1", 0, 1, NULL, "vpl.stable: share of the lights that may move elsewhere in a frame", AT(renew)},
    {"vpl.roughness", ES_SETTING_FLOAT, "0.5", 0, 1, NULL, "lobes sharper than this are widened to it, or each light would show as a spot", AT(lobe_roughness)},
    {"vpl.glossy", ES_SETTING_BOOL, "true", 0, 1, NULL, "virtual point lights emit their surface's glossy lobe too", AT(glossy_vpls)},

    {"ism.size", ES_SETTING_INT, "128", 32, 256, NULL, "texels of an imperfect shadow map's side: 32, 64, 128 or 256", AT(ism_size)},
    {"ism.points", ES_SETTING_INT, "8192", 64, 65536, NULL, "points drawn into each map, a multiple of 64", AT(ism_points)},
    {"ism.pool", ES_SETTING_INT, "1048576", 64, 16777216, NULL, "points that stand for the scene", AT(ism_pool)},
    {"ism.detail", ES_SETTING_FLOAT, "0", 0, 1, NULL, "0: as many points per area everywhere; 1: every object has as many points", AT(ism_detail)},
    {"ism.kept", ES_SETTING_INT, "64", 0, 65536, NULL, "MiB for what is kept between frames of maps whose light stays", AT(ism_kept)},
    {"ism.pull-push", ES_SETTING_BOOL, "true", 0, 1, NULL, "fill the holes between points", AT(pull_push)},
    {"ism.pull-threshold", ES_SETTING_FLOAT, "0.05", 0, 1, NULL, "largest depth difference that is averaged, share of the scene's extent", AT(pull_threshold)},
    {"ism.push-threshold", ES_SETTING_FLOAT, "0.1", 0, 1, NULL, "largest depth difference that is kept, share of the scene's extent", AT(push_threshold)},
    {"ism.levels", ES_SETTING_INT, "2", 1, 4, NULL, "pull-push levels", AT(pull_push_levels)},
    {"ism.bias", ES_SETTING_FLOAT, "0", 0, 1, NULL, "depth bias of the visibility test, share of the scene's extent", AT(ism_bias)},
    {"ism.slope-bias", ES_SETTING_FLOAT, "0.026", 0, 1, NULL, "depth bias over the cosine at the pixel, share of the scene's extent; about a splat's width", AT(ism_slope_bias)},
    {"classic.size", ES_SETTING_INT, "256", 32, 1024, NULL, "texels of a classic map's side, a power of two", AT(classic_size)},

    {"traced.bias", ES_SETTING_CHOICE, "bounded", 0, 0, "bounded|unbounded|compensated",
        "vpl.bound, vpl.spread and vpl.roughness apply, or do not, or do and rays find what they leave out", AT(traced_bias)},
    {"traced.samples", ES_SETTING_INT, "16", 1, 65536, NULL, "traced.bias compensated: rays per pixel", AT(traced_samples)},
    {"traced.interleave", ES_SETTING_BOOL, "false", 0, 1, NULL, "vpl-traced: interleave and filter.passes apply; otherwise every pixel has every light", AT(traced_interleave)},

    {"micro.size", ES_SETTING_INT, "24", 8, 32, NULL, "pixels of a micro-buffer's side, a multiple of 4", AT(micro_size)},
    {"micro.points", ES_SETTING_INT, "1048576", 1, 8388608, NULL, "points that stand for the scene, at most", AT(micro_points)},
    {"micro.spacing", ES_SETTING_INT, "1", 1, 4, NULL, "light is gathered at every pixel, or every 2nd or 4th in each dimension: 1, 2 or 4; what lobes reflect at every 2nd at least", AT(micro_spacing)},
    {"micro.cut", ES_SETTING_FLOAT, "4", 0.01, 100, NULL, "largest solid angle of a node that is drawn and not opened, share of a pixel's; of what is shared 4 at the most", AT(micro_cut)},
    {"micro.share", ES_SETTING_FLOAT, "2", 0, 1000, NULL, "what is further than this many radii of a cell of gather points is drawn once for all of them (less than 1 is as 1); 0: each point sees for itself", AT(micro_share)},
    {"micro.cover", ES_SETTING_FLOAT, "1.3", 0.1, 100, NULL, "a node is drawn where so many times its area covers the pixel's ray, or is within 0.05 rad of a lobe's: less leaves gaps, more lets things grow", AT(micro_cover)},
    {"micro.filter", ES_SETTING_INT, "3", 1, 16, NULL, "at every pixel: side of the geometry-aware filter of the diffuse light, filter.passes times; 1: none", AT(micro_filter)},
    {"micro.ray-cast", ES_SETTING_BOOL, "true", 0, 1, NULL, "points larger than micro.cut allows are met by rays; off: they are drawn as others are, and leave holes", AT(micro_ray_cast)},
    {"micro.warp", ES_SETTING_BOOL, "true", 0, 1, NULL, "a micro-buffer's pixels are distributed as the lobe is", AT(micro_warp)},
    {"micro.nodes", ES_SETTING_CHOICE, "quantised", 0, 0, "quantised|float", "nodes of the point hierarchy: of 128 bits, or of floats", AT(micro_nodes)},
    {"micro.lobes", ES_SETTING_BOOL, "true", 0, 1, NULL, "points send what their lobes reflect of the lights where it goes; off: evenly into their hemisphere", AT(micro_lobes)},
    {"micro.light", ES_SETTING_CHOICE, "vpls", 0, 0, "direct|vpls|radiosity|photons", "what lights the points with more than one bounce: the lights alone, and virtual point lights, and themselves, or photons",
        AT(micro_light)},
    {"micro.level", ES_SETTING_INT, "12", 0, 23, NULL, "micro.light vpls and radiosity: light is found at about 2^level points, the others have it from these", AT(micro_level)},
    {"micro.iterations", ES_SETTING_INT, "0", 0, 64, NULL, "micro.light radiosity: times that it is gathered; 0: bounces - 1", AT(micro_iterations)},
    {"micro.photons", ES_SETTING_INT, "262144", 1, 16777216, NULL, "micro.light photons: sent from all lights", AT(micro_photons)},
    {"micro.rebuild", ES_SETTING_FLOAT, "1.5", 1, 1000, NULL, "how much worse than new a deforming mesh's tree of points may be before it is built anew", AT(micro_rebuild)},
    {"micro.emission", ES_SETTING_BOOL, "true", 0, 1, NULL, "glowing surfaces send light to micro-buffers; with lamps other than none they do not: their light is direct", AT(micro_emission)},

    {"lamps", ES_SETTING_CHOICE, "maps", 0, 0, "none|maps|traced|screen|ambient", "direct light of glowing surfaces and of the environment: none, of a set of lights with imperfect shadow maps, or with rays; the environment's with occlusion per direction or ambient, in screen space", AT(lamps)},
    {"lamps.count", ES_SETTING_INT, "512", 1, 16384, NULL, "lights that stand for all glowing surfaces and the environment", AT(lamp_count)},
    {"lamps.size", ES_SETTING_INT, "128", 32, 256, NULL, "texels of a side of a lamp's imperfect shadow map: 32, 64, 128 or 256", AT(lamp_size)},
    {"lamps.interleave", ES_SETTING_INT, "8", 1, 16, NULL, "n of the n × n interleaved pattern of lamps' light", AT(lamp_interleave)},
    {"lamps.vpls", ES_SETTING_INT, "256", 0, 16384, NULL, "virtual point lights of the first bounce of lamps' light", AT(lamp_vpls)},
    {"lamps.roughness", ES_SETTING_FLOAT, "0.3", 0, 1, NULL, "lobes sharper than this are widened to it, or each of a lamp's lights would show as a spot", AT(lamp_roughness)},
    {"lamps.slope-bias", ES_SETTING_FLOAT, "0.016", 0, 1, NULL, "depth bias over the cosine at the pixel, share of the scene's extent; about a splat's width", AT(lamp_slope_bias)},

    {"second.lights", ES_SETTING_INT, "300", 0, 16384, NULL, "gi second-order: lights, none of which is shadowed", AT(second_lights)},
    {"second.negative", ES_SETTING_INT, "150", 0, 16384, NULL, "gi second-order: negative lights behind what the camera sees turned away from lights", AT(second_negative)},
    {"second.threshold", ES_SETTING_FLOAT, "0.02", 0, 1000, NULL, "gi second-order: how far normals and planes differ where half the resolution will not do; 0: it never does", AT(second_threshold)},

    {"compensation.steps", ES_SETTING_INT, "0", 0, ES_RESIDUAL_STEPS, NULL, "what vpl.bound, or 1 over the square of screen.radius, takes from lights is found in screen space, so many bounces of it; vpl.spread does not apply; 0: not", AT(compensation_steps)},
    {"compensation.levels", ES_SETTING_INT, "6", 1, ES_RESIDUAL_LEVELS, NULL, "levels of the pyramid of pixels: fewer take more samples", AT(compensation_levels)},
    {"compensation.solid-angle", ES_SETTING_FLOAT, "0.08", 0, 100, NULL, "projected solid angle above which a node of the pyramid is opened, sr", AT(compensation_solid_angle)},
    {"compensation.discontinuity", ES_SETTING_FLOAT, "0.04", 0, 100, NULL, "the same where it spans an edge", AT(compensation_discontinuity)},
    {"compensation.spacing", ES_SETTING_INT, "2", 1, 4, NULL, "found at every pixel, or every 2nd or 4th in each dimension: 1, 2 or 4", AT(compensation_spacing)},

    {"interleave", ES_SETTING_INT, "8", 1, 16, NULL, "n of the n × n interleaved pattern", AT(interleave)},
    {"filter.passes", ES_SETTING_INT, "2", 0, 4, NULL, "geometry-aware n × n box filters one after another: 0 none, 2 a smooth tent; n is interleave, with gi micro micro.filter", AT(filter_passes)},
    {"filter.depth", ES_SETTING_FLOAT, "0.03", 0, 1, NULL, "largest relative depth difference the filter crosses", AT(filter_depth)},
    {"filter.normal", ES_SETTING_FLOAT, "0.8", -1, 1, NULL, "smallest dot product of normals the filter crosses", AT(filter_normal)},
    {"half-resolution", ES_SETTING_BOOL, "false", 0, 1, NULL, "indirect light for one pixel of 2 × 2; the others are interpolated along their surface; not with gi micro", AT(half_resolution)},

    {"screen.samples", ES_SETTING_INT, "8", 1, 64, NULL, "screen space: places that each pixel looks at around it", AT(screen_samples)},
    {"screen.sets", ES_SETTING_INT, "4", 1, 8, NULL, "n of n × n patterns of such places, and of the filter that brings them together", AT(screen_sets)},
    {"screen.radius", ES_SETTING_FLOAT, "0.05", 1e-6, 1, NULL, "how far away those places are at the most, share of the scene's extent", AT(screen_radius)},
    {"screen.layers", ES_SETTING_INT, "1", 1, 4, NULL, "surfaces behind one another that each pixel knows of; 2 and 4: where objects begin and end", AT(screen_layers)},
    {"screen.cameras", ES_SETTING_INT, "0", 0, 4, NULL, "additional cameras, of half the resolution, that show what the camera does not", AT(screen_cameras)},
    {"screen.repair", ES_SETTING_INT, "0", 0, 64, NULL, "places towards each light that are tested for what the depth bias of its shadow map leaves out; 0: none", AT(screen_repair)},
    {"screen.repair-least", ES_SETTING_FLOAT, "0", 0, 1, NULL, "screen.repair: how far away from the pixel these places reach at least, share of the scene's extent; 0: as far as the bias", AT(screen_repair_least)},
    {"screen.bounce", ES_SETTING_BOOL, "false", 0, 1, NULL, "light that surfaces within screen.radius send each other, from half as many places: what vpl.bound, then 1 / radius² at the most, leaves out (vpl.spread is 0 then), with gi none all of it; not with gi micro", AT(screen_bounce)},

    {"blend.layers", ES_SETTING_INT, "4", 0, ES_BLEND_MAX_LAYERS, NULL, "blended surfaces in front of the picture that are peeled from it, lit and composited; of more the nearest; 0: they are drawn as masked", AT(blend_layers)},

    {"reflections", ES_SETTING_CHOICE, "none", 0, 0, "none|maps|traced", "what mirrors and glossy things show of what is around them: nothing but highlights of lights, or a picture, looked up in a cube map of each thing's surroundings or found by rays", AT(reflections)},
    {"reflections.roughness", ES_SETTING_FLOAT, "0.3", 0, 1, NULL, "surfaces of at most this roughness reflect a picture", AT(reflection_roughness)},
    {"reflections.maps", ES_SETTING_INT, "8", 1, ES_REFLECTION_MOST_MAPS, NULL, "reflections maps: things that have a map, at most; those that look largest", AT(reflection_maps)},
    {"reflections.edits", ES_SETTING_BOOL, "true", 0, 1, NULL, "what the world's regions and constraints say reflects where they say, highlights and micro-buffers as well; off: as the law of reflection has it", AT(reflection_edits)},
    {"reflections.size", ES_SETTING_INT, "256", 16, 1024, NULL, "reflections maps: texels of a side of each of a map's six faces, a power of two", AT(reflection_size)},
    {"reflections.rays", ES_SETTING_INT, "4", 1, 256, NULL, "reflections traced: rays for each pixel whose lobe is no mirror's", AT(reflection_rays)},

    {"temporal", ES_SETTING_BOOL, "false", 0, 1, NULL, "temporal coherence: indirect light is blended with last frame's by confidence", AT(temporal)},
    {"temporal.stage", ES_SETTING_CHOICE, "after-filter", 0, 0, "after-filter|before-filter", "where last frame's light comes in", AT(temporal_stage)},
    {"temporal.base", ES_SETTING_FLOAT, "0.9", 0, 0.999, NULL, "confidence in last frame's light where nothing changes", AT(temporal_base)},
    {"temporal.position", ES_SETTING_FLOAT, "1", 0, 1000, NULL, "how movement lowers the confidence, per share of the picture or of the scene's extent", AT(temporal_position)},
    {"temporal.normal", ES_SETTING_FLOAT, "1", 0, 1000, NULL, "how a turned normal lowers the confidence, per 1 - cosine", AT(temporal_normal)},
    {"temporal.illumination", ES_SETTING_FLOAT, "0.05", 0, 1000, NULL, "how changed light lowers the confidence, per cube of the difference as shown on white", AT(temporal_illumination)},
    {"temporal.depth-threshold", ES_SETTING_FLOAT, "0.03", 0, 1, NULL, "another surface: largest relative difference of depth", AT(temporal_depth_threshold)},
    {"temporal.normal-threshold", ES_SETTING_FLOAT, "0.8", -1, 1, NULL, "another surface: smallest dot product of normals", AT(temporal_normal_threshold)},
    {"temporal.clamp", ES_SETTING_FLOAT, "0", 0, 10, NULL, "last frame's light is kept within its new neighbourhood's, widened by this share; 0: not", AT(temporal_clamp)},
    {"temporal.reset-low", ES_SETTING_FLOAT, "0.4", 0, 10, NULL, "share by which a tile's light differs from its history's where the confidence begins to fall", AT(temporal_reset_low)},
    {"temporal.reset-high", ES_SETTING_FLOAT, "1", 0, 10, NULL, "share from which on history is not used; 0: tiles are not compared", AT(temporal_reset_high)},
    {"temporal.settle", ES_SETTING_INT, "64", 1, 100000, NULL, "frames without a change after which a picture is settled and nothing is left to do", AT(temporal_settle)},

    {"antialias", ES_SETTING_CHOICE, "none", 0, 0, "none|temporal|supersample", "smooth edges: over frames by motion, or by several pictures each frame", AT(antialias)},
    {"antialias.samples", ES_SETTING_INT, "16", 1, 64, NULL, "places inside a pixel that are sampled", AT(antialias_samples)},
    {"antialias.blend", ES_SETTING_FLOAT, "0.1", 0.01, 1, NULL, "antialias temporal: share of the new frame where things move", AT(antialias_blend)},

    {"glare", ES_SETTING_CHOICE, "off", 0, 0, "off|convolution|billboards", "light spreads in the eye that looks at the picture: all of it, or that of the brightest places", AT(glare)},
    {"glare.size", ES_SETTING_INT, "512", 64, 4096, NULL, "glare: pixels of the aperture's side, a power of two; more reaches further", AT(glare_size)},
    {"glare.width", ES_SETTING_FLOAT, "9", 1, 20, NULL, "glare: side of the plane that the aperture is drawn in, mm; less reaches further, and what is outside is dark", AT(glare_width)},
    {"glare.field", ES_SETTING_FLOAT, "10", 0.1, 170, NULL, "glare: degrees of the eye's view that the picture's width spans", AT(glare_field)},
    {"glare.wavelengths", ES_SETTING_INT, "32", 1, 64, NULL, "glare: of 380 to 770 nm", AT(glare_wavelengths)},
    {"glare.supersample", ES_SETTING_INT, "2", 1, 8, NULL, "glare: n of n × n places that a pixel of the aperture is drawn at: 1, 2, 4 or 8", AT(glare_supersample)},
    {"glare.defocus", ES_SETTING_FLOAT, "0", -3, 3, NULL, "glare: dioptres that the eye's lens is off; 0: sharp", AT(glare_defocus)},
    {"glare.cycle", ES_SETTING_INT, "0", 0, 256, NULL, "glare: spectra that are made once and shown 30 a second, there and back again; 0: each frame has its own", AT(glare_cycle)},
    {"glare.threshold", ES_SETTING_FLOAT, "10", 0, 1000000, NULL, "glare billboards: radiance above which light spreads", AT(glare_threshold)},
    {"glare.billboards", ES_SETTING_INT, "256", 0, 4096, NULL, "glare billboards: at most so many", AT(glare_billboards)},
    {"glare.seed", ES_SETTING_INT, "0", 0, 1000000, NULL, "glare: whose eye it is", AT(glare_seed)},
    {"glare.pupil", ES_SETTING_FLOAT, "-1", -1, 9, NULL, "glare: mean diameter of the pupil, mm; below 0: by the field's luminance", AT(glare_pupil)},
    {"glare.hippus", ES_SETTING_FLOAT, "0.125", 0, 1, NULL, "glare: how the pupil fluctuates; 0: not", AT(glare_hippus)},
    {"glare.cornea", ES_SETTING_BOOL, "true", 0, 1, NULL, "glare: particles of the cornea, which do not move", AT(glare_cornea)},
    {"glare.lens", ES_SETTING_BOOL, "true", 0, 1, NULL, "glare: particles of the lens", AT(glare_lens)},
    {"glare.gratings", ES_SETTING_BOOL, "true", 0, 1, NULL, "glare: fibres of the lens: a coloured ring, where the pupil is wide", AT(glare_gratings)},
    {"glare.accommodation", ES_SETTING_FLOAT, "1", 0, 20, NULL, "glare: how the lens is deformed, times what is usual; 0: not", AT(glare_accommodation)},
    {"glare.vitreous", ES_SETTING_BOOL, "true", 0, 1, NULL, "glare: particles of the vitreous humour", AT(glare_vitreous)},
    {"glare.saccades", ES_SETTING_FLOAT, "1", 0, 20, NULL, "glare: how the vitreous humour is turned by the eye's jumps, times what is usual; 0: not", AT(glare_saccades)},
    {"glare.lids", ES_SETTING_BOOL, "true", 0, 1, NULL, "glare: eyelids", AT(glare_lids)},
    {"glare.lashes", ES_SETTING_BOOL, "true", 0, 1, NULL, "glare: lashes, with glare.lids", AT(glare_lashes)},
    {"glare.blink", ES_SETTING_BOOL, "true", 0, 1, NULL, "glare: now and then the lids shut, but for a slit", AT(glare_blink)},
    {"glare.squint", ES_SETTING_FLOAT, "1", 0, 1.2, NULL, "glare: how far lids shut before what is bright, times what is usual; 0: not", AT(glare_squint)},

    {"tone-map", ES_SETTING_CHOICE, "reinhard", 0, 0, "reinhard|pbr-neutral|linear", "display transform", AT(tone_map)},
    {"white", ES_SETTING_FLOAT, "4", 0.01, 100000, NULL, "Reinhard: radiance times exposure that is shown as white", AT(white)},
    {"exposure", ES_SETTING_FLOAT, "0", -20, 20, NULL, "stops", AT(exposure)},
    {"exposure.adapt", ES_SETTING_FLOAT, "0", 0, 1000, NULL, "seconds in which the exposure gets used to a brighter picture, four times as many to a darker one; 0: it does not", AT(exposure_adapt)},
    {"exposure.key", ES_SETTING_FLOAT, "0.18", 0.001, 100, NULL, "exposure.adapt: radiance times exposure that the picture's logarithmic mean gets, before stops", AT(exposure_key)},
};

size_t es_renderer_setting_count(void) { return sizeof renderer_table / sizeof renderer_table[0]; }

const es_setting* es_renderer_setting(size_t index) { return index < es_renderer_setting_count() ? &renderer_table[index] : NULL; }

es_renderer_settings es_default_renderer_settings(void)
{
    es_renderer_settings settings = {0};
    es_settings_defaults(renderer_table, es_renderer_setting_count(), &settings);
    return settings;
}

es_result es_renderer_settings_set(es_context* context, es_renderer_settings* settings, const char* name, const char* value)
{
    return es_settings_set(context, renderer_table, es_renderer_setting_count(), settings, name, value);
}
