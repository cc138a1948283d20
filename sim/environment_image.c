#include "sim/environment.h"

#include <string.h>

#include "platform/context.h"
#include "platform/maths.h"

/* Taylor's series for 0 … pi / 4, error 3e-16. In float, rows of fine pictures would differ in height. */
static double sine_of(double x)
{
    const double z = x * x;
    double sum = 1.0;
    for (int n = 14; n; n -= 2) sum = 1.0 - sum * z / (n * (n + 1));
    return x * sum;
}

void es_elevation_sines(uint32_t height, double* sines)
{
    for (uint32_t i = 0; i <= height; i++) {
        /* 1 - 2 sin² (θ / 2) from the nearer pole: the cosine of a small angle would keep nothing of it */
        const uint32_t from_pole = i <= height - i ? i : height - i;
        const double sine = sine_of(0.5 * 3.14159265358979323846 * from_pole / height), y = 1.0 - 2.0 * sine * sine;
        sines[i] = 2 * i == height ? 0.0 : i <= height - i ? y : -y;
    }
}

/* ---- what is no light ------------------------------------------------------------------------------------------------------- */

typedef struct texel_reader {
    const es_image* image;
    int channel[3];
    uint64_t bad;
    uint32_t first_x, first_y;
    float first_value;
} texel_reader;

static void read_texel(texel_reader* r, uint32_t x, uint32_t y, float rgb[3])
{
    const float* texel = r->image->pixels + ((size_t)y * r->image->width + x) * r->image->channels;
    for (int k = 0; k < 3; k++) {
        rgb[k] = texel[r->channel[k]];
        if (es_within(rgb[k], 0, ES_RADIANCE_LIMIT)) {
            if (rgb[k] == 0.0f) rgb[k] = 0.0f; /* -0 as well */
            continue;
        }
        if (!r->bad++) {
            r->first_x = x;
            r->first_y = y;
            r->first_value = rgb[k];
        }
        rgb[k] = 0.0f;
    }
}

/* ---- smaller ----------------------------------------------------------------------------------------------------------------------- */

/* Each texel is the mean over what it covers of the larger image, weighted by solid angle: nothing of the power is lost. */
static bool shrink(es_context* context, texel_reader* reader, es_image* copy)
{
    const uint32_t width = reader->image->width, height = reader->image->height;
    double* sines = es_allocate_array(context, height + 1 + copy->height + 1, sizeof *sines);
    double* row = es_allocate_array(context, 3 * copy->width, sizeof *row);
    if (!sines || !row) {
        es_release(context, sines, (height + 1 + copy->height + 1) * sizeof *sines);
        es_release(context, row, 3 * copy->width * sizeof *row);
        return false;
    }
    double* to_sines = sines + height + 1;
    es_elevation_sines(height, sines);
    es_elevation_sines(copy->height, to_sines);
    const double columns = (double)width / copy->width;
    uint32_t to = 0;
    for (uint32_t y = 0; y < height; y++) {
        memset(row, 0, 3 * copy->width * sizeof *row);
        for (uint32_t x = 0, into = 0; x < width; x++) {
            float rgb[3];
            read_texel(reader, x, y, rgb);
            for (double at = x; at < x + 1.0 && into < copy->width;) {
                const double end = (into + 1) * columns, next = end < x + 1.0 ? end : x + 1.0;
                for (int k = 0; k < 3; k++) row[3 * into + (uint32_t)k] += (double)rgb[k] * ((next - at) / columns);
                if (end <= next) into++;
                at = next;
            }
        }
        for (double at = sines[y]; at > sines[y + 1] && to < copy->height;) {
            const double end = to_sines[to + 1], next = end > sines[y + 1] ? end : sines[y + 1], share = (at - next) / (to_sines[to] - end);
            float* out = copy->pixels + 3 * (size_t)to * copy->width;
            for (uint32_t i = 0; i < 3 * copy->width; i++) out[i] += (float)(row[i] * share);
            if (end >= next) to++;
            at = next;
        }
    }
    es_release(context, sines, (height + 1 + copy->height + 1) * sizeof *sines);
    es_release(context, row, 3 * copy->width * sizeof *row);
    return true;
}

/* R, G and B by name, or the first three */
bool es_environment_copy(es_context* context, const char* label, const es_image* image, es_image* copy)
{
    const uint32_t width = image->width < ES_ENVIRONMENT_MAX_WIDTH ? image->width : ES_ENVIRONMENT_MAX_WIDTH;
    const uint32_t height = image->height < ES_ENVIRONMENT_MAX_HEIGHT ? image->height : ES_ENVIRONMENT_MAX_HEIGHT;
    if (es_image_create(context, width, height, 3, copy) != ES_OK) return false;
    texel_reader reader = {.image = image, .channel = {0, 1, 2}};
    if (image->channel_names) {
        int named[3] = {es_image_channel(image, "R"), es_image_channel(image, "G"), es_image_channel(image, "B")};
        if (named[0] >= 0 && named[1] >= 0 && named[2] >= 0) memcpy(reader.channel, named, sizeof named);
    }
    if (width < image->width || height < image->height) {
        if (!shrink(context, &reader, copy)) {
            es_image_destroy(context, copy);
            return false;
        }
    } else {
        for (uint32_t y = 0; y < height; y++)
            for (uint32_t x = 0; x < width; x++) read_texel(&reader, x, y, copy->pixels + 3 * ((size_t)y * width + x));
    }
    if (reader.bad)
        es_log(context, ES_LOG_WARNING, ES_ASSET_WARNING, "%s: %llu values of its image were not within 0 … 1e12 and are 0 now, the first %g at (%u, %u)", label,
            (unsigned long long)reader.bad, (double)reader.first_value, reader.first_x, reader.first_y);
    return true;
}

/* ---- cubes -------------------------------------------------------------------------------------------------------------------------- */

/* Between four texels of a face, the nearest inside at its edges. */
static void face_at(const es_image* face, float u, float v, float rgb[3])
{
    const float last_x = (float)(face->width - 1), last_y = (float)(face->height - 1);
    const float x = es_clampf(u * (float)face->width - 0.5f, 0.0f, last_x), y = es_clampf(v * (float)face->height - 0.5f, 0.0f, last_y);
    const uint32_t x0 = (uint32_t)x, y0 = (uint32_t)y, x1 = x0 + 1 < face->width ? x0 + 1 : x0, y1 = y0 + 1 < face->height ? y0 + 1 : y0;
    const float right = x - (float)x0, down = y - (float)y0;
    const float* rows[2] = {face->pixels + (size_t)y0 * face->width * face->channels, face->pixels + (size_t)y1 * face->width * face->channels};
    for (uint32_t k = 0; k < 3; k++) {
        const float top = rows[0][x0 * face->channels + k] * (1.0f - right) + rows[0][x1 * face->channels + k] * right;
        const float bottom = rows[1][x0 * face->channels + k] * (1.0f - right) + rows[1][x1 * face->channels + k] * right;
        rgb[k] = top * (1.0f - down) + bottom * down;
    }
}

/* OpenGL 4.6 specification, table 8.19, but s from the other side */
static void cube_at(const es_image faces[6], es_vec3 d, float rgb[3])
{
    const float ax = es_absf(d.x), ay = es_absf(d.y), az = es_absf(d.z);
    uint32_t face;
    float s, t, major;
    if (ax >= ay && ax >= az) {
        face = d.x < 0.0f;
        s = d.x < 0.0f ? d.z : -d.z;
        t = -d.y;
        major = ax;
    } else if (ay >= az) {
        face = d.y < 0.0f ? 3 : 2;
        s = d.x;
        t = d.y < 0.0f ? -d.z : d.z;
        major = ay;
    } else {
        face = d.z < 0.0f ? 5 : 4;
        s = d.z < 0.0f ? -d.x : d.x;
        t = -d.y;
        major = az;
    }
    face_at(&faces[face], 0.5f * (1.0f - s / major), 0.5f * (t / major + 1.0f), rgb);
}

bool es_environment_from_cube(es_context* context, const es_image faces[6], es_quat rotation, es_image* image)
{
    enum { PARTS = 2 }; /* of a texel, along each side */
    uint32_t width = 4 * faces[0].width;
    if (width > ES_ENVIRONMENT_MAX_WIDTH) width = ES_ENVIRONMENT_MAX_WIDTH;
    const es_quat back = {-rotation.x, -rotation.y, -rotation.z, rotation.w};
    if (es_image_create(context, width, width / 2, 3, image) != ES_OK) return false;
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++) {
            float* out = image->pixels + 3 * ((size_t)y * width + x);
            for (uint32_t part = 0; part < PARTS * PARTS; part++) {
                const float v = ((float)y + ((float)(part / PARTS) + 0.5f) / PARTS) / (float)image->height, u = ((float)x + ((float)(part % PARTS) + 0.5f) / PARTS) / (float)width;
                float sine, cosine, s, c, rgb[3];
                es_sincos(ES_PI * v, &sine, &cosine);
                es_sincos(2.0f * ES_PI * (u - 0.5f), &s, &c);
                cube_at(faces, es_quat_rotate(back, es_v3(sine * s, cosine, -sine * c)), rgb);
                for (int k = 0; k < 3; k++) out[k] += rgb[k] * (1.0f / (PARTS * PARTS));
            }
        }
    return true;
}
