/* Choosing the points of a manifold. */
#include "sim/rigid/manifold.h"

static void take(es_manifold* manifold, const es_contact_point* p)
{
    uint32_t at = manifold->count++; /* by id: an insertion into at most four */
    while (at > 0 && manifold->points[at - 1].id > p->id) {
        manifold->points[at] = manifold->points[at - 1];
        at--;
    }
    manifold->points[at] = (es_manifold_point){p->point, p->separation, p->id, 0, {0, 0}};
}

static void make_ids_different(es_manifold* manifold)
{
    for (uint32_t i = 1; i < manifold->count; i++)
        if (manifold->points[i].id <= manifold->points[i - 1].id) manifold->points[i].id = manifold->points[i - 1].id + 1;
}

void es_manifold_choose(es_manifold* manifold, const es_contact_point* c, uint32_t count)
{
    manifold->count = 0;
    if (count <= ES_MANIFOLD_POINTS) {
        for (uint32_t i = 0; i < count; i++) take(manifold, &c[i]);
        make_ids_different(manifold);
        return;
    }
    uint32_t first = 0, second = 0, third = 0, fourth = 0;
    for (uint32_t i = 1; i < count; i++)
        if (c[i].separation < c[first].separation || (c[i].separation == c[first].separation && c[i].id < c[first].id)) first = i;
    float best = -1;
    for (uint32_t i = 0; i < count; i++) {
        es_vec3 d = es_v3_sub(c[i].point, c[first].point);
        float squared = es_v3_dot(d, d);
        if (squared > best && i != first) {
            best = squared;
            second = i;
        }
    }
    /* signed areas about the normal: the largest of either sign, then the largest of the other sign against any side of the triangle */
    es_vec3 n = manifold->normal, side = es_v3_cross(n, es_v3_sub(c[second].point, c[first].point));
    best = -1;
    float sign = 1;
    for (uint32_t i = 0; i < count; i++) {
        float area = es_v3_dot(side, es_v3_sub(c[i].point, c[first].point));
        if (i != first && i != second && es_absf(area) > best) {
            best = es_absf(area);
            sign = area < 0 ? -1.0f : 1.0f;
            third = i;
        }
    }
    const uint32_t corner[4] = {first, sign > 0 ? second : third, sign > 0 ? third : second, first};
    best = 0;
    fourth = count;
    for (uint32_t i = 0; i < count; i++) {
        if (i == first || i == second || i == third) continue;
        for (int k = 0; k < 3; k++) {
            es_vec3 from = c[corner[k]].point, along = es_v3_cross(n, es_v3_sub(c[corner[k + 1]].point, from));
            float outside = -es_v3_dot(along, es_v3_sub(c[i].point, from));
            if (outside > best) {
                best = outside;
                fourth = i;
            }
        }
    }
    take(manifold, &c[first]);
    take(manifold, &c[second]);
    take(manifold, &c[third]);
    if (fourth < count) take(manifold, &c[fourth]);
    make_ids_different(manifold);
}
