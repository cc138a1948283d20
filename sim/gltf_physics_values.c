/* Values of the file and places of its nodes, for what makes bodies of them. */
#include "sim/gltf_physics_parts.h"

#include <stdio.h>
#include <string.h>

#include "sim/world.h"

/* ---- reading --------------------------------------------------------------------------------------------------------------------- */

es_result es_gltf_damaged(const es_gltf_loader* l, const char* where, const char* what) { return es_fail(l->in->context, ES_FILE_DAMAGED, "%s: %s: %s", l->in->path, where, what); }

es_result es_gltf_damaged_member(const es_gltf_loader* l, const char* where, const char* name, const char* what)
{
    return es_fail(l->in->context, ES_FILE_DAMAGED, "%s: %s.%s: %s", l->in->path, where, name, what);
}

const void* es_gltf_member(const es_gltf_loader* l, const void* object, const char* name) { return object ? l->in->values->member(object, name) : NULL; }

/* A number within [low, high] where there is one; *value keeps what it has where not. */
es_result es_gltf_number(const es_gltf_loader* l, const void* object, const char* name, double low, double high, const char* where, float* value)
{
    const void* found = es_gltf_member(l, object, name);
    double number;
    if (!found) return ES_OK;
    if (!l->in->values->number(found, &number)) return es_gltf_damaged_member(l, where, name, "must be a number");
    if (!(number >= low && number <= high))
        return es_fail(l->in->context, ES_FILE_DAMAGED, "%s: %s.%s: is %g, must lie in %g … %g", l->in->path, where, name, number, low, high);
    *value = (float)number;
    return ES_OK;
}

es_result es_gltf_numbers(const es_gltf_loader* l, const void* object, const char* name, size_t count, double low, double high, const char* where, float* values)
{
    const void* found = es_gltf_member(l, object, name);
    size_t length;
    if (!found) return ES_OK;
    if (!l->in->values->array_length(found, &length) || length != count)
        return es_fail(l->in->context, ES_FILE_DAMAGED, "%s: %s.%s: must be an array of %zu numbers", l->in->path, where, name, count);
    for (size_t i = 0; i < count; i++) {
        double number;
        if (!l->in->values->number(l->in->values->element(found, i), &number) || !(number >= low && number <= high))
            return es_fail(l->in->context, ES_FILE_DAMAGED, "%s: %s.%s[%zu]: must be a number in %g … %g", l->in->path, where, name, i, low, high);
        values[i] = (float)number;
    }
    return ES_OK;
}

es_result es_gltf_flag(const es_gltf_loader* l, const void* object, const char* name, const char* where, bool* value)
{
    const void* found = es_gltf_member(l, object, name);
    if (found && !l->in->values->boolean(found, value)) return es_gltf_damaged_member(l, where, name, "must be true or false");
    return ES_OK;
}

/* A whole number below `count`; *index is -1 where there is none. */
es_result es_gltf_index(const es_gltf_loader* l, const void* object, const char* name, size_t count, const char* where, int32_t* index)
{
    const void* found = es_gltf_member(l, object, name);
    double number;
    *index = -1;
    if (!found) return ES_OK;
    if (!l->in->values->number(found, &number) || !(number >= 0 && number < (double)count) || number != (double)(int32_t)number)
        return es_fail(l->in->context, ES_FILE_DAMAGED, "%s: %s.%s: must be a whole number below %zu", l->in->path, where, name, count);
    *index = (int32_t)number;
    return ES_OK;
}

/* One of `words`, which end with NULL; *choice keeps what it has where there is none. */
es_result es_gltf_word(const es_gltf_loader* l, const void* object, const char* name, const char* const* words, const char* where, uint32_t* choice)
{
    const void* found = es_gltf_member(l, object, name);
    if (!found) return ES_OK;
    const char* text = l->in->values->string(found);
    char list[160] = "";
    for (uint32_t i = 0; words[i]; i++) {
        if (text && strcmp(text, words[i]) == 0) {
            *choice = i;
            return ES_OK;
        }
        snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", i ? ", " : "", words[i]);
    }
    return es_fail(l->in->context, ES_FILE_DAMAGED, "%s: %s.%s: must be one of %s", l->in->path, where, name, list);
}

/* Element `index` of a list of the file's, which must be an object. */
es_result es_gltf_listed(const es_gltf_loader* l, const void* owner, const char* list, int32_t index, const char* where, const void** value)
{
    const void* array = es_gltf_member(l, owner, list);
    size_t length = 0;
    if (!array || !l->in->values->array_length(array, &length) || (size_t)index >= length)
        return es_fail(l->in->context, ES_FILE_DAMAGED, "%s: %s: names number %d of %s, there are %zu", l->in->path, where, index, list, length);
    *value = l->in->values->element(array, (size_t)index);
    return l->in->values->is_object(*value) ? ES_OK : es_gltf_damaged(l, where, "names something that is no object");
}

const void* es_gltf_rigid_part(const es_gltf_loader* l, uint32_t n, const char* name) { return es_gltf_member(l, l->in->nodes[n].rigid, name); }

/* extras.earthshine.body; NULL where the node has the extension's words */
const void* es_gltf_extras_part(const es_gltf_loader* l, uint32_t n, const char* name) { return l->in->nodes[n].rigid ? NULL : es_gltf_member(l, l->in->nodes[n].extras, name); }

/* ---- places ---------------------------------------------------------------------------------------------------------------------- */

/* Quaternion of a rotation given by its columns, by the largest of its four components (Shepperd 1978). */
static es_quat rotation_of(double a[3][3])
{
    double x = 1 + a[0][0] - a[1][1] - a[2][2], y = 1 - a[0][0] + a[1][1] - a[2][2], z = 1 - a[0][0] - a[1][1] + a[2][2], w = 1 + a[0][0] + a[1][1] + a[2][2];
    if (w >= x && w >= y && w >= z) return es_quat_normalize((es_quat){(float)(a[1][2] - a[2][1]), (float)(a[2][0] - a[0][2]), (float)(a[0][1] - a[1][0]), (float)w});
    if (x >= y && x >= z) return es_quat_normalize((es_quat){(float)x, (float)(a[0][1] + a[1][0]), (float)(a[2][0] + a[0][2]), (float)(a[1][2] - a[2][1])});
    if (y >= z) return es_quat_normalize((es_quat){(float)(a[0][1] + a[1][0]), (float)y, (float)(a[1][2] + a[2][1]), (float)(a[2][0] - a[0][2])});
    return es_quat_normalize((es_quat){(float)(a[2][0] + a[0][2]), (float)(a[1][2] + a[2][1]), (float)z, (float)(a[0][1] - a[1][0])});
}

es_gltf_place es_gltf_place_of(const es_world* world, es_node node)
{
    const es_mat4* m = es_node_world(world, node);
    es_gltf_place p = {.scale = es_v3(1, 1, 1), .rotation = es_quat_identity()};
    memcpy(p.position, es_node_position(world, node), sizeof p.position);
    double axes[3][3], length[3];
    for (int c = 0; c < 3; c++) {
        double x = m->m[4 * c], y = m->m[4 * c + 1], z = m->m[4 * c + 2];
        length[c] = __builtin_sqrt(x * x + y * y + z * z);
        double inverse = length[c] > 1e-30 ? 1 / length[c] : 0;
        axes[c][0] = x * inverse;
        axes[c][1] = y * inverse;
        axes[c][2] = z * inverse;
    }
    p.scale = es_v3((float)length[0], (float)length[1], (float)length[2]);
    if (length[0] < 1e-30 || length[1] < 1e-30 || length[2] < 1e-30) return p;
    double cross[3] = {axes[1][1] * axes[2][2] - axes[1][2] * axes[2][1], axes[1][2] * axes[2][0] - axes[1][0] * axes[2][2], axes[1][0] * axes[2][1] - axes[1][1] * axes[2][0]};
    if (axes[0][0] * cross[0] + axes[0][1] * cross[1] + axes[0][2] * cross[2] < 0) { /* mirrored: in x */
        p.scale.x = -p.scale.x;
        for (int k = 0; k < 3; k++) axes[0][k] = -axes[0][k];
    }
    p.rotation = rotation_of(axes);
    return p;
}

static es_quat conjugate(es_quat q) { return (es_quat){-q.x, -q.y, -q.z, q.w}; }

/* `what` seen from the axes of `from`, without scale. */
void es_gltf_seen_from(const es_gltf_place* from, const es_gltf_place* what, es_vec3* position, es_quat* rotation)
{
    es_quat back = conjugate(from->rotation);
    es_vec3 d = es_v3((float)(what->position[0] - from->position[0]), (float)(what->position[1] - from->position[1]), (float)(what->position[2] - from->position[2]));
    *position = es_quat_rotate(back, d);
    *rotation = es_quat_normalize(es_quat_mul(back, what->rotation));
}

