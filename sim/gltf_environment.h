/* The environment that a scene of a glTF file refers to by EXT_lights_image_based: a cube of six images, turned and scaled.
 *
 * Of the prefiltered levels the first is the environment itself; the others, and the coefficients of its irradiance, are made of it where they are wanted. */
#ifndef EARTHSHINE_SIM_GLTF_ENVIRONMENT_H
#define EARTHSHINE_SIM_GLTF_ENVIRONMENT_H

#include "sim/gltf_file.h"
#include "sim/gltf_values.h"
#include "sim/sim.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct es_gltf_environment {
    es_context* context;
    const char* path;                  /* of the file, for messages */
    const es_gltf_values* values;
    const void *use, *root;            /* the extension of the scene, not NULL, and of the file */
    size_t scene, image_count;         /* its number; images of the file */
    /* once it is read */
    size_t light;                      /* its number */
    size_t images[6];                  /* numbers of the faces' images: +X, -X, +Y, -Y, +Z, -Z */
    es_quat rotation;                  /* unit */
    float intensity;
    es_image faces[6];                 /* linear radiance, three channels; owned */
} es_gltf_environment;

/* In this order. Failures have one line that names the place in the file. */
es_result es_gltf_environment_read(es_gltf_environment* environment);
/* Decoded pixels of four bytes each of images[face]: sRGB, and divided by alpha ("RGBD"). All faces are squares of one size. */
es_result es_gltf_environment_face(es_gltf_environment* environment, size_t face, const es_gltf_image_header* header, const uint8_t* rgba);
es_result es_gltf_environment_set(const es_gltf_environment* environment, es_world* world);
/* The faces, as many as there are. */
void es_gltf_environment_free(es_gltf_environment* environment);

#ifdef __cplusplus
}
#endif
#endif
