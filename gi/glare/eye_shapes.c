#include "gi/glare/eye_shapes.h"

#include "platform/maths.h"

void es_eye_add_line(es_eye_shapes* shapes, es_vec2 a, es_vec2 b, float from, float to)
{
    if (shapes->quad_count >= ES_EYE_MOST_QUADS) return;
    const float dx = b.x - a.x, dy = b.y - a.y, length = es_sqrt(dx * dx + dy * dy);
    if (!(length > 1e-6f)) return;
    const float nx = -dy / length, ny = dx / length;
    shapes->quads[shapes->quad_count++] = (es_eye_quad){{{a.x + from * nx, a.y + from * ny}, {b.x + to * nx, b.y + to * ny}, {b.x - to * nx, b.y - to * ny}, {a.x - from * nx, a.y - from * ny}}};
}
