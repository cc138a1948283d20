/* Embree's path tracer of one diffuse bounce over the peers' room of 70,000 triangles: time and error for 1, 2, 4, 8 … samples a pixel, raw
 * and after its geometry-aware box of 8 × 8. Built and run by `earthshine bench`, with the folder of the peer's program on the
 * include path.
 *
 * usage: REFERENCE THREADS SECONDS   REFERENCE: float32 RGB radiance, 1024 × 768, top row first. Doubles the samples until the raw relRMSE
 *                                    is below 0.05 or the next doubling would end after SECONDS. */
#define main peer_main
#include "embree_peer.c"
#undef main

typedef struct measured { double rmse, l1; } measured;

/* Relative to the reference's mean; `sum` holds irradiance over pi of `samples` samples. */
static measured error_of(const float* sum, int samples, const float* reference)
{
    double squares = 0, differences = 0, mean = 0;
    for (int i = 0; i < W * H; i++)
        for (int k = 0; k < 3; k++) {
            double difference = (double)sum[3 * i + k] / samples * G[i].A[k] - reference[3 * i + k];
            squares += difference * difference;
            differences += fabs(difference);
            mean += reference[3 * i + k];
        }
    return (measured){sqrt(squares / (3.0 * W * H)) / (mean / (3.0 * W * H)), differences / mean};
}

static void report(int samples, const char* filter, double seconds, measured error)
{
    char name[96];
    sprintf(name, "%d%s time", samples, filter);
    row(name, seconds, "s");
    sprintf(name, "%d%s relrmse", samples, filter);
    row(name, error.rmse, "-");
    sprintf(name, "%d%s rell1", samples, filter);
    row(name, error.l1, "-");
}

int main(int count, char** arguments)
{
    if (count != 4) return 2;
    NT = atoi(arguments[2]);
    if (NT < 1 || NT > 16) return 2;
    double limit = atof(arguments[3]), spent = 0;
    const size_t size = 3 * W * H;
    float *sum = calloc(size, sizeof *sum), *filtered = malloc(size * sizeof *sum), *reference = malloc(size * sizeof *sum);
    G = calloc(W * H, sizeof *G);
    FILE* file = fopen(arguments[1], "rb");
    if (!sum || !filtered || !reference || !G || !file || fread(reference, sizeof *reference, size, file) != size) return 1;
    fclose(file);
    char threads[32];
    sprintf(threads, "threads=%d", NT);
    RTCDevice device = rtcNewDevice(threads);
    tf = tanf(CAM_FOVY * 3.14159265f / 360.f);
    S = scene_make(70000);
    rs = mk(device, &S, RTC_BUILD_QUALITY_MEDIUM, 0, 0);
    rtcCommitScene(rs);
    for (int i = 0; i < 2; i++) { /* the second time is warm */
        double start = now_s();
        par(t_gbuf, 0, TX * TY);
        spent = now_s() - start;
    }
    row("primary time", spent, "s");
    spent = 0;
    for (int done = 0, samples = 1; samples <= 4096; done = samples, samples *= 2) {
        double start = now_s();
        PT paths = {sum, done, samples, 0x1111u, 1};
        par(t_pt, &paths, TX * TY);
        double took = now_s() - start;
        spent += took;
        measured error = error_of(sum, samples, reference);
        report(samples, "", spent, error);
        start = now_s();
        BF box = {sum, filtered};
        par(t_box, &box, TX * TY);
        report(samples, " box", spent + (now_s() - start), error_of(filtered, samples, reference));
        if (error.rmse < 0.05 || spent + 2 * took > limit) break;
    }
    return 0;
}
