/* What a renderer keeps of its reflections (gi/reflections/reflection_passes.h). */
#ifndef EARTHSHINE_GI_REFLECTIONS_REFLECTIONS_H
#define EARTHSHINE_GI_REFLECTIONS_REFLECTIONS_H

#include "gi/history.h"
#include "gi/layer_light.h"
#include "gi/reflections/reflecting.h"

/* Texels of a map that show another thing with a map: what that reflects is added to what else they show. Arrays of `count`, in multiples of eight. */
typedef struct es_second_reflections {
    int32_t *texel, *map;       /* from the map's first; of the other thing, -1 in what fills up the last eight */
    float *position[3], *direction[3], *alpha, *albedo[3];
    float* base[3];             /* what the texel shows without */
    float* seen[3];             /* radiance from the other map */
    uint32_t count, capacity;
    void* memory;
    size_t bytes;
} es_second_reflections;

typedef struct es_reflection_map {
    uint32_t instance;          /* id + 1; 0: free */
    bool wanted;                /* in this frame */
    uint32_t place;             /* of the instance in the frame's list of what light meets */
    es_vec3 centre;
    float near_plane;
    uint32_t last_level;
    uint64_t drawn;             /* hash of all that it was drawn from; 0: it was not */
    es_second_reflections second;
} es_reflection_map;

/* Memory of es_reflecting_planes. */
typedef struct es_reflecting_buffers {
    es_reflecting_planes planes;
    es_planes direction, albedo;
    size_t pixels, chunks;
} es_reflecting_buffers;

/* Memory that surfaces of one size are lit in (gi/reflections/found_light.h). */
typedef struct es_found_light {
    es_layer_light lamps, indirect;
    es_planes direct;
    size_t pixels;
} es_found_light;

/* What rays have met, and what it sends back (gi/reflections/traced.h). Of the size of the rectangle that they began in. */
typedef struct es_traced_level {
    es_gbuffer hits;            /* depth: distance along the ray, metres; 0 where none is, or it has met nothing */
    es_planes found, along;     /* positions, relative to the world's origin; directions, unit */
    es_planes background;       /* radiance of rays that have met nothing */
    es_planes weight;           /* of the ray among those of its pixel */
    es_planes radiance, second; /* of the hits; what they reflect of others */
    es_planes sum, weights;     /* over a pixel's rays */
    es_reflecting_buffers reflecting;
    es_found_light light;
} es_traced_level;

typedef struct es_reflections {
    /* things that have maps, in no particular order */
    es_reflection_map* maps;
    size_t map_capacity;
    uint32_t map_count;         /* of which some may be free */
    uint32_t* map_of;           /* by instance id + 1 */
    size_t map_of_capacity, map_of_count;
    es_reflection_layout layout;
    float* texels;              /* of all maps */
    size_t texel_maps;          /* there is room for */
    float *centre[3], *last_level;
    size_t centre_capacity[3], level_capacity;

    /* what a face is drawn and lit in */
    es_gbuffer face;
    es_draw_list others;        /* all but the thing itself */
    es_raster_instance* instances;
    size_t instance_capacity;
    es_found_light face_light;
    es_planes background, radiance;

    es_traced_level levels[2];
    bool wants_rays;            /* in this frame */
    bool has_glass;             /* likewise */

    /* where light leaves glass: its planes' directions are the original ones, (0, 0, 0) elsewhere, and albedo is what arrives of it */
    es_reflecting_buffers on_glass;
    es_planes glass_position, glass_edited, glass_light;
    bool glass_is_edited;
    uint8_t* any;               /* es_reflecting_planes.any of either */
    size_t any_capacity;

    es_reflecting_buffers on_face, on_picture;
    es_planes light;            /* reflected radiance */
} es_reflections;

#endif
