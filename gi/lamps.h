/* Surfaces that glow, and the environment, as a set of lights (Ritschel thesis §5.4.3).
 *
 * Of the glowing surfaces, each triangle is a cell, or where a texture or a mask makes its radiance vary, 4, 16 … parts of it are. A cell has the
 * mean radiance L of its texels and an area A, and twice that where both its sides glow. N lights stand along the running sum of luminance(L) A,
 * at equal steps, so that every light has the same luminance; one of a cell stands for an area of step / luminance(L) and sends
 *     pi L · area      as a Lambert surface does.
 * In a cell they stand by what is left of that place and by multiples of the golden ratio, which makes a lattice of those of a large triangle. The
 * order along the sum is a scrambled radical inverse: the lights of each subset of an interleaved pattern are spread over the whole of it.
 *
 * Places go by the pose at rest and are kept as triangle and barycentric coordinates, so that they follow what moves and deforms and do not change
 * while it does; areas are those of the moment. Another material, mesh or size of an object makes another set.
 *
 * Of the environment, lights at infinity (gi/environment.h) follow those of the surfaces, and share the set's number with them by power: what all
 * surfaces send, and what arrives on a sphere about the world, in eighths, so that small changes leave places as they are. A texel much brighter than
 * all others is one light, and few of an interleaved pattern's pixels would have it: what has more than the mean is shaded as several lights that share
 * its map, and these are spread over the subsets. */
#ifndef EARTHSHINE_GI_LAMPS_H
#define EARTHSHINE_GI_LAMPS_H

#include "gi/environment.h"
#include "gi/vpl.h"
#include "platform/context.h"

/* Where a light stands. */
typedef struct es_lamp_place {
    uint32_t instance, triangle;
    float u, v;                /* barycentric coordinates of the second and third vertex */
    float radiance[3];
    double area;               /* m² at rest that the light stands for … */
    double triangle_area;      /* … where its whole triangle has that, by es_area_by_gram */
    bool back;                 /* sends to the triangle's back */
} es_lamp_place;

typedef struct es_lamps {
    es_vpl_record* records;    /* of surfaces, then of the environment: those that have maps */
    uint32_t count, glowing;
    es_vpl_record* shaded;     /* for interleaved shading, parts of these */
    uint32_t* map_of;          /* of each of these its place among the records */
    uint32_t shaded_count;
    es_lamp_place* places;
    size_t record_capacity, place_capacity, shaded_capacity, map_capacity;
    uint64_t key;              /* of what the places go by; 0: there are none */
    double power;              /* luminance of what all glowing surfaces send, W, at rest */
} es_lamps;

typedef struct es_lamp_request {
    const es_draw_list* list;
    uint64_t materials;        /* revision */
    uint32_t count;            /* lights */
    uint32_t subsets;          /* of the interleaved pattern */
    uint32_t seed;
    const es_environment_map* environment; /* NULL: none */
    es_vec3 centre;            /* of the world's bounds … */
    float extent;              /* … and their diagonal, metres; lights stand a share of it above their surface, which is not to hide them */
} es_lamp_request;

/* Is there an instance whose material glows? Its texture may be black. */
bool es_something_glows(const es_draw_list* list);
/* Brings places and records up to the list: `count` of them, fewer where the environment has no more, none where nothing sends light. */
es_result es_lamps_update(es_context* context, es_lamps* lamps, const es_lamp_request* request);
void es_lamps_free(es_context* context, es_lamps* lamps);

#endif
