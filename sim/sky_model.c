/* The clear sky after Preetham, Shirley and Smits 1999, "A Practical Analytic Model for Daylight"; the sun's place after the Astronomical Almanac's low
 * precision formulas (as in Michalsky 1988, "The Astronomical Almanac's algorithm for approximate solar position"): within 0.01 degrees from 1950 to 2050.
 *
 * Units: luminance becomes radiance by 179 lm/W, the efficacy of equal energy over the visible spectrum (Ward's Radiance), so that all numbers are
 * of visible light.
 *
 * Preetham's sky is one of day, and at sunset many times as bright as skies are: from 10 degrees down it is dimmed, to some 1100 lux on the ground at 0. With the sun
 * below the horizon its shape is that of the sun at the horizon, and its brightness falls by a factor of ten every 2.5 degrees, to a few lux at the end of civil
 * twilight (-6) and a hundredth at that of nautical twilight (-12), until what is left is the night's own 2e-4 cd/m². */
#include "platform/context.h"
#include "platform/maths.h"
#include "sim/sky.h"

#define DEGREE 0.017453292519943295
static const float lumens_per_watt = 179.0f;

/* ---- the sun ---------------------------------------------------------------------------------------------------------------------- */

double es_days_since_2000(int year, int month, int day)
{
    /* days of the civil calendar, counted in eras of 400 years that begin in March (Hinnant, "chrono-compatible low-level date algorithms") */
    const int y = year - (month <= 2), era = (y >= 0 ? y : y - 399) / 400, of_era = y - 400 * era;
    const int of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1, days = of_era * 365 + of_era / 4 - of_era / 100 + of_year;
    return (double)era * 146097.0 + days - 719468.0 - 10957.0 - 0.5;
}

/* Of an angle in degrees of any size, so that es_sin is asked for less than a turn. */
static float reduced(double degrees)
{
    const double turns = degrees / 360.0;
    return (float)((turns - (double)(int64_t)turns) * 360.0 * DEGREE);
}

void es_sun_position(double days, double latitude, double longitude, double east_up_north[3])
{
    const float anomaly = reduced(357.528 + 0.9856003 * days);
    const double ecliptic = 280.460 + 0.9856474 * days + 1.915 * (double)es_sin(anomaly) + 0.020 * (double)es_sin(2.0f * anomaly), obliquity = 23.439 - 4e-7 * days;
    float sine_l, cosine_l, sine_o, cosine_o, sine_s, cosine_s, sine_p, cosine_p;
    es_sincos(reduced(ecliptic), &sine_l, &cosine_l);
    es_sincos(reduced(obliquity), &sine_o, &cosine_o);
    /* of the equator: towards the vernal equinox, a quarter turn east of it, north */
    const double x = (double)cosine_l, y = (double)cosine_o * (double)sine_l, z = (double)sine_o * (double)sine_l;
    /* the meridian's sidereal time; 18.697375 h at the epoch's noon */
    es_sincos(reduced(18.697374558 * 15.0 + 360.98564736629 * days + longitude / DEGREE), &sine_s, &cosine_s);
    es_sincos((float)latitude, &sine_p, &cosine_p);
    const double out = x * (double)cosine_s + y * (double)sine_s, east = y * (double)cosine_s - x * (double)sine_s;
    east_up_north[0] = east;
    east_up_north[1] = (double)sine_p * z + (double)cosine_p * out;
    east_up_north[2] = (double)cosine_p * z - (double)sine_p * out;
}

void es_sun_irradiance(double elevation, float turbidity, float rgb[3])
{
    /* outside the air: 133 klx of a black body of 5800 K, as linear Rec.709 of luminance 1 */
    static const float outside[3] = {1.110f, 0.976f, 0.917f};
    /* wavelengths that stand for the channels, micrometres, and ozone's absorption there, 1/cm (Preetham, table 2) */
    static const float wavelength[3] = {0.610f, 0.550f, 0.465f}, ozone[3] = {0.120f, 0.085f, 0.009f};
    const float degrees = (float)(elevation / DEGREE);
    /* the disc, 0.53 degrees wide, sets */
    const float disc = es_clampf((degrees + 0.265f) / 0.53f, 0.0f, 1.0f), share = disc * disc * (3.0f - 2.0f * disc);
    /* relative optical mass (Kasten 1966), haze by Ångström's formula */
    const float zenith = 90.0f - es_maxf(degrees, 0.0f), mass = 1.0f / (es_sin(es_maxf((float)elevation, 0.0f)) + 0.15f * es_pow(93.885f - zenith, -1.253f));
    const float haze = es_maxf(0.04608365822050f * turbidity - 0.04586025928522f, 0.0f);
    for (int k = 0; k < 3; k++) {
        const float rayleigh = 0.008735f * es_pow(wavelength[k], -4.08f), aerosol = haze * es_pow(wavelength[k], -1.3f);
        rgb[k] = share > 0.0f ? share * (133000.0f / lumens_per_watt) * outside[k] * es_exp(-mass * (rayleigh + aerosol + ozone[k] * 0.35f)) : 0.0f;
        if (!(rgb[k] > 1e-6f)) rgb[k] = 0.0f;
    }
}

/* ---- the sky ----------------------------------------------------------------------------------------------------------------------------- */

/* Of luminance and the two chromaticities (Preetham, appendix A.2): A … E of Perez' formula as slope × turbidity + offset. */
static const float perez_slope[3][5] = {
    {0.1787f, -0.3554f, -0.0227f, 0.1206f, -0.0670f}, {-0.0193f, -0.0665f, -0.0004f, -0.0641f, -0.0033f}, {-0.0167f, -0.0950f, -0.0079f, -0.0441f, -0.0109f}};
static const float perez_offset[3][5] = {
    {-1.4630f, 0.4275f, 5.3251f, -2.5771f, 0.3703f}, {-0.2592f, 0.0008f, 0.2125f, -0.8989f, 0.0452f}, {-0.2608f, 0.0092f, 0.2102f, -1.6537f, 0.0529f}};

/* Zenith chromaticities: rows of turbidity² , turbidity, 1; columns of zenith angle³ … 1. */
static const float zenith_x[3][4] = {{0.00166f, -0.00375f, 0.00209f, 0.0f}, {-0.02903f, 0.06377f, -0.03202f, 0.00394f}, {0.11693f, -0.21196f, 0.06052f, 0.25886f}};
static const float zenith_y[3][4] = {{0.00275f, -0.00610f, 0.00317f, 0.0f}, {-0.04214f, 0.08970f, -0.04153f, 0.00516f}, {0.15346f, -0.26756f, 0.06670f, 0.26688f}};

static float zenith_chromaticity(const float table[3][4], float turbidity, float angle)
{
    float sum = 0.0f;
    for (int i = 0; i < 3; i++) sum = sum * turbidity + (((table[i][0] * angle + table[i][1]) * angle + table[i][2]) * angle + table[i][3]);
    return sum;
}

typedef struct sky_model {
    float perez[3][5], zenith[3]; /* the zenith's values over the formula's there */
    float brightness;
    es_vec3 sun;
} sky_model;

static float perez(const float c[5], float horizon, float gamma, float cosine) { return (1.0f + c[0] * horizon) * (1.0f + c[2] * es_exp(c[3] * gamma) + c[4] * cosine * cosine); }

static sky_model make_model(const es_sky_picture* p)
{
    sky_model m;
    const float t = p->turbidity, lowest = (float)(0.5 * DEGREE), elevation = es_maxf(p->elevation, lowest), angle = 0.5f * ES_PI - elevation;
    float sine, cosine;
    es_sincos(elevation, &sine, &cosine);
    m.sun = es_v3(0.0f, sine, -cosine);
    const float chi = (4.0f / 9.0f - t / 120.0f) * (ES_PI - 2.0f * angle);
    const float kilo = es_maxf((4.0453f * t - 4.9710f) * es_tan(chi) - 0.2155f * t + 2.4192f, 0.05f);
    const float values[3] = {1000.0f * kilo / lumens_per_watt, zenith_chromaticity(zenith_x, t, angle), zenith_chromaticity(zenith_y, t, angle)};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 5; k++) m.perez[i][k] = perez_slope[i][k] * t + perez_offset[i][k];
        m.zenith[i] = values[i] / perez(m.perez[i], es_exp(m.perez[i][1]), angle, sine);
    }
    /* decades */
    const float degrees = p->elevation / (float)DEGREE, below = es_clampf(10.0f - degrees, 0.0f, 10.0f);
    m.brightness = es_exp2(3.32192809f * (0.4f * es_minf(degrees, 0.0f) - 0.009f * below * below));
    return m;
}

/* Linear Rec.709 of a direction at or above the horizon; the colour is brought to where no channel is negative. */
static void sky_radiance(const sky_model* m, const float horizon[3], es_vec3 d, float rgb[3])
{
    const float cosine = es_clampf(es_v3_dot(d, m->sun), -1.0f, 1.0f), gamma = es_acos(cosine);
    float v[3];
    for (int i = 0; i < 3; i++) v[i] = m->zenith[i] * perez(m->perez[i], horizon[i], gamma, cosine);
    const float luminance = es_maxf(v[0], 0.0f), y = es_maxf(v[2], 0.05f), x = v[1], a = luminance * x / y, c = luminance * (1.0f - x - y) / y;
    /* the night's own: 2e-4 cd/m² */
    static const float night[3] = {0.8e-6f, 1.1e-6f, 1.7e-6f};
    rgb[0] = 3.2404542f * a - 1.5371385f * luminance - 0.4985314f * c;
    rgb[1] = -0.9692660f * a + 1.8760108f * luminance + 0.0415560f * c;
    rgb[2] = 0.0556434f * a - 0.2040259f * luminance + 1.0572252f * c;
    for (int k = 0; k < 3; k++) rgb[k] = es_maxf(rgb[k], 0.0f) * m->brightness + night[k];
}

typedef struct sky_loop { sky_model model; float* pixels; } sky_loop;

static void sky_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const sky_loop* loop = user;
    for (uint32_t y = begin; y < end; y++) {
        float sine, cosine, horizon[3];
        es_sincos(ES_PI * ((float)y + 0.5f) / ES_SKY_HEIGHT, &sine, &cosine);
        for (int i = 0; i < 3; i++) horizon[i] = es_exp(loop->model.perez[i][1] / es_maxf(cosine, 0.01f));
        float* row = loop->pixels + 3 * (size_t)y * ES_SKY_WIDTH;
        for (uint32_t x = 0; x < ES_SKY_WIDTH / 2; x++) { /* one half is the other's mirror image */
            float s, c;
            es_sincos(2.0f * ES_PI * (((float)x + 0.5f) / ES_SKY_WIDTH - 0.5f), &s, &c);
            float* rgb = row + 3 * x;
            sky_radiance(&loop->model, horizon, es_v3(sine * s, cosine, -sine * c), rgb);
            for (int k = 0; k < 3; k++) row[3 * (ES_SKY_WIDTH - 1 - x) + (uint32_t)k] = rgb[k];
        }
    }
}

void es_sky_draw(es_context* context, const es_sky_picture* picture, float* pixels)
{
    sky_loop loop = {make_model(picture), pixels};
    es_parallel_for(context, ES_SKY_HEIGHT / 2, 8, sky_rows, &loop);
    /* below the horizon the ground: diffuse, lit by sun and sky */
    double light[3] = {0, 0, 0};
    for (uint32_t y = 0; y < ES_SKY_HEIGHT / 2; y++) {
        float s0, c0, s1, c1;
        es_sincos(ES_PI * (float)y / ES_SKY_HEIGHT, &s0, &c0);
        es_sincos(ES_PI * (float)(y + 1) / ES_SKY_HEIGHT, &s1, &c1);
        const double weight = ((double)(s1 * s1) - (double)(s0 * s0)) * 0.5 * (2.0 * 3.14159265358979323846 / ES_SKY_WIDTH); /* cosine × solid angle */
        for (uint32_t x = 0; x < ES_SKY_WIDTH; x++)
            for (int k = 0; k < 3; k++) light[k] += weight * (double)pixels[3 * ((size_t)y * ES_SKY_WIDTH + x) + (uint32_t)k];
    }
    float sun[3], ground[3];
    es_sun_irradiance((double)picture->elevation, picture->turbidity, sun);
    const float sine = es_maxf(es_sin(picture->elevation), 0.0f);
    for (int k = 0; k < 3; k++) ground[k] = picture->ground_albedo[k] * (1.0f / ES_PI) * ((float)light[k] + sun[k] * sine);
    for (size_t i = (size_t)ES_SKY_WIDTH * ES_SKY_HEIGHT / 2; i < (size_t)ES_SKY_WIDTH * ES_SKY_HEIGHT; i++)
        for (int k = 0; k < 3; k++) pixels[3 * i + (size_t)k] = ground[k];
}
