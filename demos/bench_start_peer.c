/* How long llvmpipe takes from nothing to one frame with the passes of ours: context, shaders, shadow map, G-buffer, 1024
 * imperfect shadow maps of 8192 points, interleaved shading of 1024 lights, separable filter, for a scene of about 4,000
 * triangles. Built and run by `earthshine bench speed`, with the folder of the peer's program on the include path; what is
 * measured leaves out making the scene, starting the process and ending it, which ours includes. */
#define main peer_main
#include "gl_peer.c"
#undef main

static GLuint program(const char* defines, const char* vertex, const char* fragment) { return prog(defines, vertex, fragment); }

int main(void)
{
    Scene scene = scene_make(4000);
    float* points = malloc(16 * (size_t)POOL);
    float* lights = malloc(64 * NV);
    uint32_t random = 777;
    for (int i = 0; i < POOL; i++) {
        Vert* v = &scene.v[rng_u32(&random) % (uint32_t)scene.nv];
        memcpy(points + 4 * i, v->p, 12);
        points[4 * i + 3] = 0.05f;
    }
    for (int i = 0; i < NV; i++) {
        Vert* v = &scene.v[rng_u32(&random) % (uint32_t)scene.nv];
        float* light = lights + 16 * i;
        float* n = v->n;
        float across[3] = {n[2], 0, -n[0]}, flat[3] = {0, -n[2], n[1]}, *t = fabsf(n[0]) > 0.5f ? across : flat;
        float length = 1 / sqrtf(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
        memset(light, 0, 64);
        for (int k = 0; k < 3; k++)
            light[k] = v->p[k] + 0.01f * n[k], light[4 + k] = n[k], light[8 + k] = t[k] * length, light[12 + k] = v->c[k] * 0.1f;
    }

    double start = now_s();
    EGLDisplay display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, 0);
    eglInitialize(display, 0, 0);
    eglBindAPI(EGL_OPENGL_API);
    EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 5, EGL_CONTEXT_OPENGL_PROFILE_MASK,
        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, 0, attributes);
    if (!context || !eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) return 1;
    if (!strstr((const char*)glGetString(GL_RENDERER), "llvmpipe")) return 1;

    float projection[16], view[16], camera[16], light_camera[16], up[3] = {0, 1, 0}, ahead[3] = {0, 0, -1};
    m4_persp(projection, CAM_FOVY, W / (float)H, .02f, 10.f);
    m4_look(view, CAM_POS, ahead, up);
    m4_mul(camera, projection, view);
    m4_persp(projection, 92.f, 1.f, .05f, 10.f);
    m4_look(view, SPOT_POS, SPOT_DIR, up);
    m4_mul(light_camera, projection, view);
    GLuint arrays, empty;
    upload(scene, &arrays);
    glGenVertexArrays(1, &empty);
    GLuint draw = program("#define NRT 4\n#define OUTN vec2\n", VS_G, FS_G), depth_only = program("", VS_D, "void main(){}\n");
    GLuint splat = program("#define SIZED 1\n", VS_SPLAT, "void main(){}\n"), shade = program("#define SPLIT 1\n", VS_FS, FS_VPL);
    GLuint filter_x = program("#define SPLIT 1\n#define AXIS 0\n", VS_FS, FS_BOX),
           filter_y = program("#define SPLIT 1\n#define AXIS 1\n", VS_FS, FS_BOX);
    GLuint targets[4] = {tex(GL_RGBA8, W, H), tex(GL_RG16F, W, H), tex(GL_R32F, W, H), tex(GL_RG16F, W, H)};
    GLuint gbuffer = fbo(4, targets, tex(GL_DEPTH_COMPONENT32F, W, H)),
           shadow = fbo(0, 0, tex(GL_DEPTH_COMPONENT32F, 1024, 1024));
    GLuint atlas = tex(GL_DEPTH_COMPONENT32F, ATLAS, ATLAS), maps = fbo(0, 0, atlas);
    GLuint shaded = tex(GL_RGBA16F, W, H), half = tex(GL_RGBA16F, W, H), result = tex(GL_RGBA16F, W, H);
    GLuint to_shaded = fbo(1, &shaded, 0), to_half = fbo(1, &half, 0), to_result = fbo(1, &result, 0);
    GLuint point_buffer = tbo(GL_RGBA32F, points, 16 * (size_t)POOL), light_buffer = tbo(GL_RGBA32F, lights, 64 * NV);

    glEnable(GL_DEPTH_TEST);
    glEnable(GL_CULL_FACE);
    glBindVertexArray(arrays);
    glUseProgram(depth_only);
    glBindFramebuffer(GL_FRAMEBUFFER, shadow);
    glViewport(0, 0, 1024, 1024);
    glUniformMatrix4fv(0, 1, 0, light_camera);
    glClear(GL_DEPTH_BUFFER_BIT);
    glDrawElements(GL_TRIANGLES, 3 * scene.nt, GL_UNSIGNED_INT, 0);
    glUseProgram(draw);
    glBindFramebuffer(GL_FRAMEBUFFER, gbuffer);
    glViewport(0, 0, W, H);
    glUniformMatrix4fv(0, 1, 0, camera);
    glUniformMatrix4fv(1, 1, 0, camera);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glDrawElements(GL_TRIANGLES, 3 * scene.nt, GL_UNSIGNED_INT, 0);
    glEnable(GL_PROGRAM_POINT_SIZE);
    glBindVertexArray(empty);
    glUseProgram(splat);
    glBindFramebuffer(GL_FRAMEBUFFER, maps);
    glViewport(0, 0, ATLAS, ATLAS);
    glClear(GL_DEPTH_BUFFER_BIT);
    bind(0, GL_TEXTURE_BUFFER, point_buffer);
    bind(1, GL_TEXTURE_BUFFER, light_buffer);
    glDrawArraysInstanced(GL_POINTS, 0, PPV, NV);

    glDisable(GL_DEPTH_TEST);
    glDisable(GL_CULL_FACE);
    glViewport(0, 0, W, H);
    float tangent = tanf(CAM_FOVY * 3.14159265f / 360.f);
    glUseProgram(shade);
    glUniform4f(2, CAM_POS[0], CAM_POS[1], CAM_POS[2], 0);
    glUniform2f(3, tangent * W / H, tangent);
    glUniform1i(4, NV);
    glBindFramebuffer(GL_FRAMEBUFFER, to_shaded);
    bind(0, GL_TEXTURE_2D, targets[1]);
    bind(1, GL_TEXTURE_2D, targets[2]);
    bind(2, GL_TEXTURE_2D, atlas);
    bind(3, GL_TEXTURE_BUFFER, light_buffer);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glUseProgram(filter_x);
    glBindFramebuffer(GL_FRAMEBUFFER, to_half);
    bind(2, GL_TEXTURE_2D, shaded);
    bind(3, GL_TEXTURE_2D, targets[0]);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glUseProgram(filter_y);
    glBindFramebuffer(GL_FRAMEBUFFER, to_result);
    bind(2, GL_TEXTURE_2D, half);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glFinish();
    row("start to first frame", (now_s() - start) * 1e3, "ms");
    return glGetError() != 0;
}
