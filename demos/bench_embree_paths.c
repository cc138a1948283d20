/* Embree's path tracer of the peers' room, one indirect bounce: pictures at 1, 2, 4 … samples a pixel and how long each took, bare and
 * through the 8 × 8 geometry-aware box of the peer. Built and run by `earthshine bench error`, with the folder of the peer's program on
 * the include path.
 *
 * usage: FOLDER SAMPLES SECONDS THREADS   Doubles the samples until there are SAMPLES or, beyond 4, SECONDS have passed. Writes FOLDER/raw-N and
 *                                         FOLDER/box-N, float RGB radiance, 1024 × 768, top row first; prints the rows "N time" and
 *                                         "N box time", which leave out "primary time", the hits that all of them begin from. */
#define main peer_main
#include "embree_peer.c"
#undef main

static void write_radiance(const char* folder, const char* kind, int samples, const float* sums, double scale)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%s-%d", folder, kind, samples);
    FILE* file = fopen(path, "wb");
    if (!file) exit(1);
    for (int i = 0; i < W * H; i++) {
        float rgb[3];
        for (int k = 0; k < 3; k++) rgb[k] = G[i].ok ? (float)(sums[3 * i + k] * scale * G[i].A[k]) : 0;
        if (fwrite(rgb, sizeof rgb, 1, file) != 1) exit(1);
    }
    if (fclose(file) != 0) exit(1);
}

int main(int count, char** arguments)
{
    if (count != 5) return 2;
    const char* folder = arguments[1];
    int most = atoi(arguments[2]);
    double limit = atof(arguments[3]), seconds = 0;
    NT = atoi(arguments[4]);
    char configuration[64];
    snprintf(configuration, sizeof configuration, "threads=%d", NT);
    RTCDevice device = rtcNewDevice(configuration);
    tf = tanf(CAM_FOVY * 3.14159265f / 360.f);
    G = malloc(sizeof(GPix) * W * H);
    S = scene_make(70000);
    rs = mk(device, &S, RTC_BUILD_QUALITY_MEDIUM, 0, 0);
    rtcCommitScene(rs);
    double primary[5];
    for (int i = 0; i < 5; i++) {
        double start = now_s();
        par(t_gbuf, 0, TX * TY);
        primary[i] = now_s() - start;
    }
    row("primary time", median(primary, 5), "s");
    float *sums = calloc(W * H, 12), *filtered = malloc(W * H * 12);
    for (int done = 0, wanted = 1; wanted <= most && (seconds < limit || wanted <= 4); wanted *= 2) {
        double start = now_s();
        PT tracer = {sums, done, wanted, 0x1111u, 1};
        par(t_pt, &tracer, TX * TY);
        seconds += now_s() - start;
        done = wanted;
        start = now_s();
        BF box = {sums, filtered};
        par(t_box, &box, TX * TY);
        double box_seconds = now_s() - start;
        write_radiance(folder, "raw", done, sums, 1.0 / done);
        write_radiance(folder, "box", done, filtered, 1.0 / done);
        char name[64];
        snprintf(name, sizeof name, "%d time", done);
        row(name, seconds, "s");
        snprintf(name, sizeof name, "%d box time", done);
        row(name, seconds + box_seconds, "s");
    }
    return 0;
}
