/* Radiance HDR pictures (RGBE): read flat, old and new run-length coded; write new run-length coded.
 *
 * After G. Ward, "Real Pixels", Graphics Gems II (1991), and the file formats chapter of the Radiance reference. A pixel is
 * three 8-bit mantissas and a shared exponent: value = mantissa 2^(e - 136), zero for e = 0. Radiance itself adds half a
 * mantissa step on reading, because it truncates on writing; nearly all other programs do not, and here writing rounds
 * to nearest, so that powers of two return exactly and the error is at most 1/256 of the largest component.
 */
#include "platform/image_files.h"

#include <stdio.h>
#include <string.h>

typedef struct reader {
    const uint8_t* at;
    const uint8_t* end;
} reader;

/* 2^exponent as a double, for exponents of normal doubles. */
static double power_of_two(int exponent)
{
    uint64_t bits = (uint64_t)(exponent + 1023) << 52;
    double value;
    memcpy(&value, &bits, 8);
    return value;
}

/* One header line without its end; false at the end of the file or when it is longer than the format's 2048 characters. */
static bool read_line(reader* in, char line[2048])
{
    size_t n = 0;
    while (in->at < in->end) {
        char c = (char)*in->at++;
        if (c == '\n') {
            if (n && line[n - 1] == '\r') n--;
            line[n] = 0;
            return true;
        }
        if (n == 2047 || c == 0) return false;
        line[n++] = c;
    }
    return false;
}

static bool starts_with(const char* text, const char* start) { return strncmp(text, start, strlen(start)) == 0; }

/* Decimal number, not dependent on the locale. 15 digits and powers of ten up to 22 are exact in a double. */
static bool parse_number(const char** text, double* value)
{
    const char* p = *text;
    while (*p == ' ' || *p == '\t') p++;
    bool negative = *p == '-';
    if (*p == '-' || *p == '+') p++;
    double mantissa = 0;
    int exponent = 0, digits = 0;
    bool fraction = false, any = false;
    for (;; p++) {
        if (*p == '.' && !fraction) {
            fraction = true;
        } else if (*p >= '0' && *p <= '9') {
            any = true;
            if (digits < 15) {
                mantissa = mantissa * 10 + (*p - '0');
                digits += mantissa > 0;
                exponent -= fraction;
            } else if (!fraction && exponent < 400) {
                exponent++;
            }
        } else {
            break;
        }
    }
    if (!any) return false;
    if (*p == 'e' || *p == 'E') {
        const char* q = p + 1;
        bool down = *q == '-';
        if (*q == '-' || *q == '+') q++;
        if (*q >= '0' && *q <= '9') {
            int e = 0;
            for (; *q >= '0' && *q <= '9'; q++) e = e < 1000 ? e * 10 + (*q - '0') : e;
            exponent += down ? -e : e;
            p = q;
        }
    }
    for (; exponent > 0 && mantissa < 1e300; exponent--) mantissa *= 10;
    for (; exponent < 0 && mantissa > 0; exponent++) mantissa /= 10;
    *value = negative ? -mantissa : mantissa;
    *text = p;
    return true;
}

typedef struct picture {
    uint32_t width, height;  /* of the image as it is shown */
    uint32_t lines, length;  /* of the file: scan lines and pixels per line */
    bool transposed, flip_x, flip_y;
    double exposure[3];      /* file value = radiance × exposure */
} picture;

static bool parse_axis(const char** text, char* axis, bool* plus, uint32_t* size)
{
    const char* p = *text;
    while (*p == ' ') p++;
    if (*p != '+' && *p != '-') return false;
    *plus = *p++ == '+';
    if (*p != 'X' && *p != 'Y') return false;
    *axis = *p++;
    if (*p != ' ') return false;
    while (*p == ' ') p++;
    if (*p < '0' || *p > '9') return false;
    uint32_t n = 0;
    for (; *p >= '0' && *p <= '9'; p++) {
        if (n > 100000000u) return false;
        n = n * 10 + (uint32_t)(*p - '0');
    }
    *size = n;
    *text = p;
    return true;
}

static es_result read_header(es_context* context, const es_image_source* source, reader* in, picture* out)
{
    char line[2048];
    const char* label = source->label;
    *out = (picture){.exposure = {1, 1, 1}};
    bool primaries_seen = false;
    for (bool first = true;; first = false) {
        if (!read_line(in, line)) return es_fail(context, ES_FILE_DAMAGED, "'%s': the Radiance header does not end", label);
        if (!first && line[0] == 0) break;
        const char* rest = line;
        if (starts_with(line, "FORMAT=")) {  /* some writers leave it out; RGBE is the default */
            if (starts_with(line, "FORMAT=32-bit_rle_xyze")) {
                return es_fail(context, ES_FILE_UNSUPPORTED, "'%s' holds XYZE pixels; 32-bit_rle_rgbe is accepted", label);
            }
            if (!starts_with(line, "FORMAT=32-bit_rle_rgbe")) {
                return es_fail(context, ES_FILE_UNSUPPORTED, "'%s' has an unknown FORMAT; 32-bit_rle_rgbe is accepted", label);
            }
        } else if (starts_with(line, "EXPOSURE=")) {
            double value;
            rest += 9;
            if (!parse_number(&rest, &value) || !(value > 1e-30) || !(value < 1e30)) {
                return es_fail(context, ES_FILE_DAMAGED, "'%s': EXPOSURE is not a positive number", label);
            }
            for (int c = 0; c < 3; c++) out->exposure[c] *= value;
        } else if (starts_with(line, "COLORCORR=")) {
            rest += 10;
            for (int c = 0; c < 3; c++) {
                double value;
                if (!parse_number(&rest, &value) || !(value > 1e-30) || !(value < 1e30)) {
                    return es_fail(context, ES_FILE_DAMAGED, "'%s': COLORCORR is not three positive numbers", label);
                }
                out->exposure[c] *= value;
            }
        } else if (starts_with(line, "PRIMARIES=")) {
            primaries_seen = true;
        }
        for (int c = 0; c < 3; c++) {
            if (!(out->exposure[c] > 1e-30 && out->exposure[c] < 1e30)) {
                return es_fail(context, ES_FILE_DAMAGED, "'%s': the product of the EXPOSURE lines is out of range", label);
            }
        }
    }
    if (primaries_seen) es_log(context, ES_LOG_WARNING, ES_ASSET_WARNING, "'%s': PRIMARIES are taken as Rec.709, not converted", label);

    char axis[2];
    bool plus[2];
    uint32_t size[2];
    const char* text = line;
    if (!read_line(in, line) || !parse_axis(&text, &axis[0], &plus[0], &size[0]) || !parse_axis(&text, &axis[1], &plus[1], &size[1]) ||
        axis[0] == axis[1]) {
        return es_fail(context, ES_FILE_DAMAGED, "'%s': the Radiance header has no resolution line such as -Y 512 +X 1024", label);
    }
    out->lines = size[0];
    out->length = size[1];
    out->transposed = axis[0] == 'X';
    out->width = out->transposed ? size[0] : size[1];
    out->height = out->transposed ? size[1] : size[0];
    bool x_plus = out->transposed ? plus[0] : plus[1], y_plus = out->transposed ? plus[1] : plus[0];
    out->flip_x = !x_plus;
    out->flip_y = y_plus;  /* Y grows upwards in Radiance, rows grow downwards here */
    if (size[0] < 1 || size[1] < 1 || size[0] > ES_IMAGE_MAX_SIZE || size[1] > ES_IMAGE_MAX_SIZE) {
        return es_fail(context, ES_IMAGE_SIZE, "'%s' is %u x %u; 1 to %d are accepted", label, out->width, out->height, ES_IMAGE_MAX_SIZE);
    }
    return ES_OK;
}

/* Each channel of the line apart, as runs (count > 128: count - 128 times one byte) and literals. */
static bool read_new_runs(reader* in, uint8_t* line, uint32_t length)
{
    for (uint32_t channel = 0; channel < 4; channel++) {
        for (uint32_t x = 0; x < length;) {
            if (in->end - in->at < 2) return false;
            uint32_t count = *in->at++;
            if (count > 128) {
                count -= 128;
                if (count > length - x) return false;
                uint8_t value = *in->at++;
                for (; count; count--) line[4 * x++ + channel] = value;
            } else {
                if (count == 0 || count > length - x || (size_t)(in->end - in->at) < count) return false;
                for (; count; count--) line[4 * x++ + channel] = *in->at++;
            }
        }
    }
    return true;
}

/* Whole pixels; (1, 1, 1, n) repeats the last one n times, and each further such pixel counts eight bits higher. */
static bool read_old_runs(reader* in, uint8_t* line, uint32_t length)
{
    uint32_t shift = 0;
    for (uint32_t x = 0; x < length;) {
        if (in->end - in->at < 4) return false;
        const uint8_t* p = in->at;
        in->at += 4;
        if (p[0] == 1 && p[1] == 1 && p[2] == 1) {
            if (x == 0 || shift > 16) return false;
            uint32_t count = (uint32_t)p[3] << shift;
            if (count > length - x) return false;
            for (; count; count--, x++) memcpy(line + 4 * x, line + 4 * (x - 1), 4);
            shift += 8;
        } else {
            memcpy(line + 4 * x++, p, 4);
            shift = 0;
        }
    }
    return true;
}

static bool read_scan_line(reader* in, uint8_t* line, uint32_t length)
{
    if (length >= 8 && length <= 32767 && in->end - in->at >= 4 && in->at[0] == 2 && in->at[1] == 2 && in->at[2] < 128) {
        if (((uint32_t)in->at[2] << 8 | in->at[3]) != length) return false;
        in->at += 4;
        return read_new_runs(in, line, length);
    }
    return read_old_runs(in, line, length);
}

es_result es_image_read_hdr(es_context* context, const es_image_source* source, es_image* image)
{
    reader in = {source->bytes, source->bytes + source->size};
    picture picture;
    es_result result = read_header(context, source, &in, &picture);
    if (result != ES_OK) return result;
    /* The shortest coding, old runs, is four bytes per line and the count's eight more bits: three pixels cover a line of
     * 16384. New runs need 8 bytes per 127 pixels. A file below that promises pixels it cannot have. */
    if ((uint64_t)(in.end - in.at) < (uint64_t)picture.lines * 4) {
        return es_fail(context, ES_FILE_DAMAGED, "'%s' ends before its %u scan lines", source->label, picture.lines);
    }
    result = es_image_create(context, picture.width, picture.height, 3, image);
    if (result != ES_OK) return result;
    size_t line_size = (size_t)picture.length * 4;
    uint8_t* line = es_allocate(context, line_size);
    if (!line) {
        es_image_destroy(context, image);
        return es_context_last_result(context);
    }
    double inverse[3];
    for (int c = 0; c < 3; c++) inverse[c] = 1.0 / picture.exposure[c];
    for (uint32_t i = 0; i < picture.lines && result == ES_OK; i++) {
        if (!read_scan_line(&in, line, picture.length)) {
            result = es_fail(context, ES_FILE_DAMAGED, "'%s': scan line %u of %u is damaged or missing", source->label, i + 1, picture.lines);
            break;
        }
        for (uint32_t j = 0; j < picture.length; j++) {
            uint32_t x = picture.transposed ? i : j, y = picture.transposed ? j : i;
            if (picture.flip_x) x = picture.width - 1 - x;
            if (picture.flip_y) y = picture.height - 1 - y;
            float* pixel = image->pixels + ((size_t)y * picture.width + x) * 3;
            const uint8_t* code = line + 4 * (size_t)j;
            double scale = code[3] ? power_of_two(code[3] - 136) : 0.0;
            for (int c = 0; c < 3; c++) {
                double value = code[c] * scale * inverse[c];
                pixel[c] = value < 3.4028234663852886e38 ? (float)value : 3.4028234663852886e38f;
            }
        }
    }
    es_release(context, line, line_size);
    if (result != ES_OK) es_image_destroy(context, image);
    return result;
}

/* ---- write ------------------------------------------------------------------------------------------------------------ */

static void encode_pixel(const float* rgb, uint8_t code[4])
{
    float value[3], largest = 0;
    for (int c = 0; c < 3; c++) {
        value[c] = rgb[c] > 0 ? rgb[c] : 0;  /* NaN and negative: the format has neither */
        if (value[c] > largest) largest = value[c];
    }
    memset(code, 0, 4);
    if (largest < 0x1p-128f) return;  /* below half a step of the smallest exponent's first normalised mantissa */
    double wide = largest;
    uint64_t bits;
    memcpy(&bits, &wide, 8);
    int exponent = (int)(bits >> 52) - 1022;  /* largest in [2^(exponent - 1), 2^exponent); infinity: 1025 */
    if (exponent > 127) exponent = 127;
    for (;; exponent++) {
        double scale = power_of_two(8 - exponent);
        bool fits = true;
        for (int c = 0; c < 3; c++) {
            double mantissa = (double)value[c] * scale + 0.5;
            if (mantissa >= 256.0) {
                fits = exponent == 127;  /* the largest exponent saturates */
                mantissa = 255.0;
                if (!fits) break;
            }
            code[c] = (uint8_t)mantissa;
        }
        if (fits) break;
    }
    code[3] = (uint8_t)(exponent + 128);
}

/* One channel of a line as runs of at least four equal bytes and literals between them. */
static size_t encode_runs(const uint8_t* line, uint32_t length, uint32_t channel, uint8_t* out)
{
    size_t n = 0;
    for (uint32_t x = 0; x < length;) {
        uint32_t start = x, run = 0;
        while (start < length) {
            uint8_t value = line[4 * start + channel];
            for (run = 1; run < 127 && start + run < length && line[4 * (start + run) + channel] == value;) run++;
            if (run >= 4) break;
            start += run;
            run = 0;
        }
        while (x < start) {
            uint32_t count = start - x < 128 ? start - x : 128;
            out[n++] = (uint8_t)count;
            for (; count; count--) out[n++] = line[4 * x++ + channel];
        }
        if (run >= 4) {
            out[n++] = (uint8_t)(128 + run);
            out[n++] = line[4 * x + channel];
            x += run;
        }
    }
    return n;
}

es_result es_image_write_hdr(es_context* context, const es_image* image, const es_image_save_desc* desc, const char* label,
    es_image_sink* sink)
{
    if (image->channels != 3) {
        return es_fail(context, ES_INVALID_ARGUMENT, "cannot write '%s': a Radiance picture has 3 channels, the image %u", label,
            image->channels);
    }
    /* Literals cost one byte in 128 more than what they hold. */
    size_t line_size = (size_t)image->width * 4, coded_size = 4 + line_size + line_size / 64 + 16, total = line_size + coded_size;
    uint8_t* line = es_allocate(context, total);
    if (!line) return es_context_last_result(context);
    uint8_t* coded = line + line_size;
    char header[128];
    int header_size = snprintf(header, sizeof header, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %u +X %u\n", image->height, image->width);
    bool written = es_sink_write(sink, header, (size_t)header_size);
    for (uint32_t y = 0; y < image->height && written; y++) {
        const float* row = image->pixels + (size_t)y * image->width * 3;
        for (uint32_t x = 0; x < image->width; x++) encode_pixel(row + 3 * (size_t)x, line + 4 * (size_t)x);
        if (image->width < 8) {  /* too narrow for the new runs; mantissas are normalised, so (1, 1, 1, n) cannot occur */
            written = es_sink_write(sink, line, line_size);
            continue;
        }
        size_t n = 0;
        coded[n++] = 2;
        coded[n++] = 2;
        coded[n++] = (uint8_t)(image->width >> 8);
        coded[n++] = (uint8_t)image->width;
        for (uint32_t channel = 0; channel < 4; channel++) n += encode_runs(line, image->width, channel, coded + n);
        written = es_sink_write(sink, coded, n);
    }
    es_release(context, line, total);
    return written ? ES_OK : ES_FILE_WRITE;
}
