/* How those who read extensions of a glTF file in C see the JSON that another has parsed. */
#ifndef EARTHSHINE_SIM_GLTF_VALUES_H
#define EARTHSHINE_SIM_GLTF_VALUES_H

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Values of the file's JSON, held by whoever parsed it; NULL stands for what is absent. */
typedef struct es_gltf_values {
    const void* (*member)(const void* object, const char* name);   /* NULL also when it is no object */
    const void* (*element)(const void* array, size_t index);
    bool (*is_object)(const void* value);
    bool (*array_length)(const void* value, size_t* length);       /* false: no array; and so on */
    bool (*number)(const void* value, double* number);
    bool (*boolean)(const void* value, bool* boolean);
    const char* (*string)(const void* value);
} es_gltf_values;

#ifdef __cplusplus
}
#endif
#endif
