#include "gi/reflections/reflection_map.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "platform/maths.h"

enum { BASE = 64 }; /* texels of a side of level 1 */

static int32_t append(int32_t at, uint32_t size) { return at + (int32_t)(6 * (size + 2) * (size + 2)); }

es_reflection_layout es_reflection_layout_of(uint32_t size)
{
    es_reflection_layout l = {.size = size};
    const uint32_t base = size < BASE ? size : BASE;
    const uint32_t sizes[ES_REFLECTION_LEVELS] = {size, base, base, base / 2, base / 4 < 8 ? 8 : base / 4, base / 4 < 8 ? 8 : base / 4, base / 4 < 8 ? 8 : base / 4, base / 4 < 8 ? 8 : base / 4};
    int32_t at = append(0, size);
    for (uint32_t s = base; s >= 4; s /= 2) {
        const bool whole = s == size; /* level 0 is as small as that */
        l.mean_size[l.means] = (float)s;
        l.mean_first[l.means++] = whole ? 0 : at;
        if (!whole) at = append(at, s);
    }
    for (int i = 0; i < ES_REFLECTION_LEVELS; i++) {
        l.level_size[i] = (float)sizes[i];
        l.level_first[i] = i == 0 ? 0 : i == 1 ? l.mean_first[0] : at;
        if (i > 1) at = append(at, sizes[i]);
    }
    l.bounds_first = at;
    l.texels = at + 6 * ES_REFLECTION_CELLS * ES_REFLECTION_CELLS / 4;
    return l;
}

float es_reflection_level_of_alpha(float alpha)
{
    const float x = 64.0f * es_clampf(alpha, 0.0f, 1.0f);
    return x < 1.0f ? x : 1.0f + es_log2(x);
}

/* ---- places on a cube ---------------------------------------------------------------------------------------------------------- */

/* Axis, to the right and down of each face, as es_cube_views has them. */
static const float axes[6][3][3] = {
    {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}, {{-1, 0, 0}, {0, 0, -1}, {0, -1, 0}}, {{0, 1, 0}, {1, 0, 0}, {0, 0, -1}},
    {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}, {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}},  {{0, 0, -1}, {1, 0, 0}, {0, -1, 0}}};

static float along(const float a[3], const float d[3]) { return a[0] * d[0] + a[1] * d[1] + a[2] * d[2]; }

/* The texel that another face has next to (u, v), -1 … 1 but for a little more of one of them, on `face`: from the level's first. */
static size_t neighbour_texel(uint32_t face, float u, float v, uint32_t size)
{
    float d[3];
    for (int k = 0; k < 3; k++) d[k] = axes[face][0][k] + u * axes[face][1][k] + v * axes[face][2][k];
    uint32_t other = 0;
    for (uint32_t f = 1; f < 6; f++)
        if (along(axes[f][0], d) > along(axes[other][0], d)) other = f;
    const float scale = 0.5f * (float)size / along(axes[other][0], d), half = 0.5f * (float)size, last = (float)(size - 1);
    const uint32_t x = (uint32_t)es_clampf(along(axes[other][1], d) * scale + half, 0.0f, last), y = (uint32_t)es_clampf(along(axes[other][2], d) * scale + half, 0.0f, last);
    return ((size_t)other * (size + 2) + y + 1) * (size + 2) + x + 1;
}

static void copy(float* to, const float* from) { memcpy(to, from, 4 * sizeof *to); }

static void fill_borders(float* level, uint32_t size)
{
    const float beyond = 1.0f + 1e-4f, step = 2.0f / (float)size;
    const size_t stride = size + 2;
    for (uint32_t f = 0; f < 6; f++) {
        float* face = level + 4 * f * stride * stride;
        for (uint32_t i = 0; i < size; i++) {
            const float at = ((float)i + 0.5f) * step - 1.0f;
            copy(face + 4 * (i + 1), level + 4 * neighbour_texel(f, at, -beyond, size));
            copy(face + 4 * ((size + 1) * stride + i + 1), level + 4 * neighbour_texel(f, at, beyond, size));
            copy(face + 4 * ((i + 1) * stride), level + 4 * neighbour_texel(f, -beyond, at, size));
            copy(face + 4 * ((i + 1) * stride + size + 1), level + 4 * neighbour_texel(f, beyond, at, size));
        }
        for (int corner = 0; corner < 4; corner++) {
            const size_t x = corner & 1 ? size + 1 : 0, y = corner & 2 ? size + 1 : 0, own_x = x ? size : 1, own_y = y ? size : 1;
            const float *own = face + 4 * (own_y * stride + own_x), *beside = face + 4 * (own_y * stride + x), *above = face + 4 * (y * stride + own_x);
            for (int k = 0; k < 4; k++) face[4 * (y * stride + x) + (size_t)k] = (own[k] + beside[k] + above[k]) * (1.0f / 3.0f);
        }
    }
}

/* ---- bounds ------------------------------------------------------------------------------------------------------------------------ */

enum { CELLS = ES_REFLECTION_CELLS };
typedef struct bound_loop { const float* texels; uint32_t size; float* cells; /* [face][row][column] */ } bound_loop;

/* Rows of cells of all six faces, one after another: the largest of 1 over distance. */
static void bound_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const bound_loop* loop = user;
    const uint32_t n = loop->size / CELLS;
    const size_t stride = loop->size + 2;
    const float step = 2.0f / CELLS;
    for (uint32_t i = begin; i < end; i++) {
        const uint32_t face = i / CELLS, row = i % CELLS;
        for (uint32_t column = 0; column < CELLS; column++) {
            float most = 0.0f;
            for (uint32_t y = 0; y < n; y++) {
                const float* texel = loop->texels + 4 * ((face * stride + row * n + y + 1) * stride + column * n + 1) + 3;
                for (uint32_t x = 0; x < 4 * n; x += 4) most = es_maxf(texel[x], most);
            }
            /* depth along the axis is no more than distance: at the cell's corner next to the axis the two are closest */
            const float u = (float)column * step - 1.0f, v = (float)row * step - 1.0f, nu = u < 0.0f ? -(u + step) : u, nv = v < 0.0f ? -(v + step) : v;
            loop->cells[i * CELLS + column] = most / es_sqrt(1.0f + nu * nu + nv * nv);
        }
    }
}

/* A cell beside it, (column, row) being one out at the most. */
static float beside(const float* cells, uint32_t face, int32_t column, int32_t row)
{
    const bool x_out = column < 0 || column >= CELLS, y_out = row < 0 || row >= CELLS;
    if (x_out && y_out) return 0.0f; /* there is none */
    if (!x_out && !y_out) return cells[(face * CELLS + (uint32_t)row) * CELLS + (uint32_t)column];
    const float beyond = 1.0f + 1e-4f, u = ((float)column + 0.5f) * (2.0f / CELLS) - 1.0f, v = ((float)row + 0.5f) * (2.0f / CELLS) - 1.0f;
    const size_t texel = neighbour_texel(face, es_clampf(u, -beyond, beyond), es_clampf(v, -beyond, beyond), CELLS), stride = CELLS + 2;
    return cells[(texel / (stride * stride) * CELLS + texel / stride % stride - 1) * CELLS + texel % stride - 1];
}

static void make_bounds(es_context* context, const es_reflection_layout* l, float* texels)
{
    float cells[6 * CELLS * CELLS], *bounds = texels + 4 * (size_t)l->bounds_first;
    bound_loop loop = {texels, l->size, cells};
    es_parallel_for(context, 6 * CELLS, 8, bound_rows, &loop);
    for (uint32_t f = 0; f < 6; f++)
        for (int32_t row = 0; row < CELLS; row++)
            for (int32_t column = 0; column < CELLS; column++) {
                float most = 0.0f;
                for (int32_t j = -1; j <= 1; j++)
                    for (int32_t i = -1; i <= 1; i++) most = es_maxf(beside(cells, f, column + i, row + j), most);
                bounds[(f * CELLS + (uint32_t)row) * CELLS + (uint32_t)column] = most * 1.0001f;
            }
}

/* ---- levels ----------------------------------------------------------------------------------------------------------------------- */

typedef struct mean_loop { const float* from; float* to; uint32_t from_size, to_size; } mean_loop;

/* Rows of all six faces, one after another: means of n × n texels. */
static void mean_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const mean_loop* loop = user;
    const uint32_t n = loop->from_size / loop->to_size;
    const size_t from_stride = loop->from_size + 2, to_stride = loop->to_size + 2;
    const float share = 1.0f / (float)(n * n);
    for (uint32_t row = begin; row < end; row++) {
        const uint32_t face = row / loop->to_size, y = row % loop->to_size;
        for (uint32_t x = 0; x < loop->to_size; x++) {
            float sum[4] = {0, 0, 0, 0};
            for (uint32_t j = 0; j < n; j++) {
                const float* texel = loop->from + 4 * ((face * from_stride + y * n + j + 1) * from_stride + x * n + 1);
                for (uint32_t i = 0; i < 4 * n; i += 4)
                    for (uint32_t k = 0; k < 4; k++) sum[k] += texel[i + k];
            }
            float* out = loop->to + 4 * ((face * to_stride + y + 1) * to_stride + x + 1);
            for (int k = 0; k < 4; k++) out[k] = sum[k] * share;
        }
    }
}

static void make_means(es_context* context, const es_reflection_layout* l, float* texels)
{
    for (uint32_t i = 0; i < l->means; i++) {
        if (!l->mean_first[i]) continue;
        const uint32_t size = (uint32_t)l->mean_size[i];
        mean_loop loop = {texels + (i ? 4 * (size_t)l->mean_first[i - 1] : 0), texels + 4 * (size_t)l->mean_first[i], i ? (uint32_t)l->mean_size[i - 1] : l->size, size};
        es_parallel_for(context, 6 * size, 16, mean_rows, &loop);
        fill_borders(loop.to, size);
    }
}

/* Half vectors by the density D cos, lights mirrored about them: tan² = alpha² u / (1 - u) (Walter et al. 2007, eq. 35). Their density is D / 4. */
static uint32_t make_taps(float alpha, uint32_t count, const es_reflection_layout* l, es_reflection_tap* taps)
{
    uint32_t kept = 0;
    double total = 0.0;
    const float base = l->mean_size[0];
    for (uint32_t i = 0; i < count; i++) {
        const float u = ((float)i + 0.5f) / (float)count, turn = (float)i * 0.61803399f;
        const float cosine = es_sqrt((1.0f - u) / (1.0f + (alpha * alpha - 1.0f) * u)), sine = es_sqrt(es_maxf(1.0f - cosine * cosine, 0.0f));
        const float up = 2.0f * cosine * cosine - 1.0f;
        if (!(up > 0.0f)) continue;
        const float narrow = cosine * cosine * (alpha * alpha - 1.0f) + 1.0f, density = alpha * alpha / (4.0f * ES_PI * narrow * narrow);
        float s, c;
        es_sincos(2.0f * ES_PI * (turn - es_floor(turn)), &s, &c);
        es_reflection_tap* tap = &taps[kept++];
        *tap = (es_reflection_tap){{2.0f * cosine * sine * c, 2.0f * cosine * sine * s, up}, 0.0f, up};
        const float solid_angle = 1.0f / ((float)count * density), texel = 4.0f * ES_PI / (6.0f * base * base);
        tap->level = es_clampf(0.5f * es_log2(solid_angle / texel), 0.0f, (float)(l->means - 1));
        total += (double)up;
    }
    for (uint32_t i = 0; i < kept; i++) taps[i].weight = (float)((double)taps[i].weight / total);
    return kept;
}

typedef struct lobe_loop { const es_gi_kernels* kernels; const es_reflection_lobe_job* job; } lobe_loop;

static void lobe_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const lobe_loop* loop = user;
    loop->kernels->reflection_lobe(loop->job, begin, end);
}

es_result es_reflection_map_finish(es_context* context, const es_reflection_layout* l, float* texels, uint32_t last_level)
{
    fill_borders(texels, l->size);
    make_bounds(context, l, texels);
    if (last_level) make_means(context, l, texels);
    es_reflection_tap taps[ES_REFLECTION_TAPS];
    for (uint32_t i = 2; i <= last_level; i++) {
        const uint32_t size = (uint32_t)l->level_size[i];
        es_reflection_lobe_job job = {.texels = texels, .layout = l, .taps = taps, .level = i, .out = texels + 4 * (size_t)l->level_first[i]};
        job.tap_count = make_taps(0x1p-7f * (float)(2u << (i - 1)), i < 4 ? ES_REFLECTION_TAPS / 2 : ES_REFLECTION_TAPS, l, taps);
        lobe_loop loop = {es_gi_kernel_table(es_context_isa(context)), &job};
        es_parallel_for(context, 6 * size, 8, lobe_rows, &loop);
        fill_borders(job.out, size);
    }
    return ES_OK;
}

/* ---- level 0 ------------------------------------------------------------------------------------------------------------------------ */

typedef struct face_loop { const es_gi_kernels* kernels; const es_reflection_face_job* job; } face_loop;

static void face_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const face_loop* loop = user;
    loop->kernels->reflection_face(loop->job, begin, end);
}

void es_reflection_face(es_context* context, const es_reflection_face_job* job)
{
    face_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->size, 16, face_rows, &loop);
}

void es_reflection_ask(const es_context* context, const es_reflection_atlas* atlas, const es_reflection_question* question)
{
    es_gi_kernel_table(es_context_isa(context))->reflection_ask(atlas, question);
}
