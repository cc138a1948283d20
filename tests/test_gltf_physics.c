/* Bodies and joints that glTF files declare: shapes, masses, places, filters, triggers and joints by KHR_physics_rigid_bodies and by extras;
 * what they do; and damaged ones, each with one line that says where. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "platform/context.h"
#include "platform/maths.h"
#include "sim/sim.h"

static struct { es_context* context; char path[64], log[4096]; int errors; } fixture;

static void keep_log(void* user, es_log_level level, es_result item, const char* message)
{
    fixture.errors += level == ES_LOG_ERROR;
    snprintf(fixture.log + strlen(fixture.log), sizeof fixture.log - strlen(fixture.log), "%s\n", message);
    assert_null(strchr(message, '\n'));
}

static int set_up(void** state)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.logger.log = keep_log;
    desc.memory_cap = (size_t)1 << 30;
    strcpy(fixture.path, "/tmp/earthshine-physics-XXXXXX");
    int file = mkstemp(fixture.path);
    if (file < 0) return -1;
    close(file);
    return es_context_create(&desc, &fixture.context) == ES_OK ? 0 : -1;
}

static int tear_down(void** state)
{
    unlink(fixture.path);
    es_context_destroy(fixture.context);
    return 0;
}

/* ' stands for " */
static es_result import(const char* json, es_world** world)
{
    FILE* file = fopen(fixture.path, "wb");
    assert_non_null(file);
    for (const char* c = json; *c; c++) fputc(*c == '\'' ? '"' : *c, file);
    fclose(file);
    fixture.log[0] = 0;
    fixture.errors = 0;
    size_t before = es_context_bytes(fixture.context);
    es_result result = es_world_import_gltf(fixture.context, fixture.path, NULL, world);
    if (result != ES_OK) assert_int_equal(es_context_bytes(fixture.context), before);
    return result;
}

static es_world* load(const char* json)
{
    es_world* world;
    if (import(json, &world) != ES_OK) fail_msg("%s", es_context_message(fixture.context));
    return world;
}

static void refuse(const char* part, const char* json)
{
    es_world* world;
    es_result result = import(json, &world);
    if (result == ES_OK || !strstr(es_context_message(fixture.context), part)) fail_msg("wanted '%s', got %s: %s\n%s", part, es_result_name(result), es_context_message(fixture.context), json);
    assert_int_equal(fixture.errors, 1);
}

static es_body body_at(es_world* world, const char* node)
{
    uint32_t ids[32];
    size_t count = 32;
    es_node wanted = es_world_find_node(world, node);
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_BODY, ids, &count), ES_OK);
    for (size_t i = 0; i < count; i++) {
        es_body_state state;
        assert_int_equal(es_world_get_body(world, (es_body){ids[i]}, &state), ES_OK);
        if (state.node.id == wanted.id) return (es_body){ids[i]};
    }
    fail_msg("node %s has no body", node);
    return (es_body){0};
}

static es_body_state state_of(es_world* world, const char* node)
{
    es_body_state state;
    assert_int_equal(es_world_get_body(world, body_at(world, node), &state), ES_OK);
    return state;
}

static size_t count_of(es_world* world, es_object_kind kind)
{
    size_t count = 0;
    assert_int_equal(es_world_enumerate(world, kind, NULL, &count), ES_OK);
    return count;
}

static void steps(es_world* world, int count)
{
    for (int i = 0; i < count; i++) assert_int_equal(es_world_step(world, 1.0f / 60), ES_OK);
}

static void near(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) fail_msg("%g, expected %g", value, expected);
}

/* A unit tetrahedron as mesh 0: corners at 0, x, y, z. */
#define MESH "'buffers':[{'byteLength':72,'uri':'data:application/octet-stream;base64," \
    "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAACAAEAAAABAAMAAAADAAIAAQACAAMA'}]," \
    "'bufferViews':[{'buffer':0,'byteLength':48},{'buffer':0,'byteOffset':48,'byteLength':24}]," \
    "'accessors':[{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'},{'bufferView':1,'componentType':5123,'count':12,'type':'SCALAR'}]," \
    "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1}]},{'primitives':[{'attributes':{'POSITION':0},'indices':1}]}],"
#define FILE_JSON(rigid, shapes, nodes) "{'asset':{'version':'2.0'},'extensionsUsed':['KHR_physics_rigid_bodies','KHR_implicit_shapes']," MESH \
    "'extensions':{'KHR_physics_rigid_bodies':{" rigid "},'KHR_implicit_shapes':{'shapes':[" shapes "]}},'nodes':[" nodes "]}"
#define RIGID(members) "'extensions':{'KHR_physics_rigid_bodies':{" members "}}"
#define COLLIDER(shape) "'collider':{'geometry':{'shape':" shape "}}"
#define SHAPES "{'type':'box','box':{'size':[20,2,20]}},{'type':'sphere','sphere':{'radius':0.5}},{'type':'capsule','capsule':{'height':1,'radiusBottom':0.25,'radiusTop':0.25}}," \
    "{'type':'cylinder','cylinder':{'height':1,'radiusBottom':0.5,'radiusTop':0.5}},{'type':'box'}"
#define FLOOR "{'name':'floor','translation':[0,-1,0]," RIGID(COLLIDER("0")) "}"

static void falling(void** state)
{
    es_world* world = load(FILE_JSON("'physicsMaterials':[{'dynamicFriction':0.3,'restitution':0}]", SHAPES,
        FLOOR ",{'name':'ball','mesh':0,'translation':[0,2,0]," RIGID("'motion':{'mass':3,'linearVelocity':[0.5,0,0]},'collider':{'geometry':{'shape':1},'physicsMaterial':0}") "},"
        "{'name':'bar','translation':[4,2,0],'children':[3]," RIGID("'motion':{}") "},{'translation':[0,0,1],'rotation':[0.70710678,0,0,0.70710678]," RIGID(COLLIDER("2")) "},"
        "{'name':'can','translation':[-4,1,0],'scale':[1,2,1]," RIGID("'motion':{'mass':1}," COLLIDER("3")) "},"
        "{'name':'still','translation':[-8,3,0]," RIGID("'motion':{'gravityFactor':0}," COLLIDER("4")) "},"
        "{'name':'lift','translation':[8,1,0]," RIGID("'motion':{'isKinematic':true}," COLLIDER("4")) "},"
        "{'name':'rock','mesh':0,'translation':[0,3,6]," RIGID("'motion':{},'collider':{'geometry':{'node':7,'convexHull':true}}") "}"));
    assert_int_equal(count_of(world, ES_OBJECT_BODY), 7);
    near(state_of(world, "ball").mass, 3, 1e-6);
    near(state_of(world, "ball").velocity.x, 0.5, 1e-6);
    near(state_of(world, "bar").local_centre.z, 1, 1e-5); /* its collider hangs a metre beside its node */
    near(state_of(world, "bar").mass, 1000 * (3.14159265 * 0.0625 * 1 + 4.0 / 3 * 3.14159265 * 0.015625), 0.5);
    near(state_of(world, "rock").mass, 1000.0 / 6, 0.1);
    assert_int_equal(state_of(world, "floor").type, ES_BODY_STATIC);
    assert_int_equal(state_of(world, "lift").type, ES_BODY_KINEMATIC);
    steps(world, 180);
    near(state_of(world, "ball").position[1], 0.5, 0.02);
    near(state_of(world, "bar").position[1], 0.25, 0.02); /* lies, turned about x, on its side */
    near(state_of(world, "can").position[1], 1, 0.02);    /* stands, two metres high */
    near(state_of(world, "still").position[1], 3, 1e-6);
    assert_true(state_of(world, "rock").position[1] < 1.1 && state_of(world, "rock").position[1] > -0.1);
    es_mat4 m; /* the node follows */
    assert_int_equal(es_world_get_node_matrix(world, es_world_find_node(world, "ball"), &m), ES_OK);
    near(m.m[13], 0.5, 0.02);
    es_world_destroy(world);
}

static void filters_and_triggers(void** state)
{
    es_world* world = load(FILE_JSON("'collisionFilters':[{'collisionSystems':['ghost'],'notCollideWithSystems':['ground']},{'collisionSystems':['ground']},{'collideWithSystems':['ground']}]", SHAPES,
        "{'name':'floor','translation':[0,-1,0]," RIGID("'collider':{'geometry':{'shape':0},'collisionFilter':1}") "},"
        "{'name':'ghost','translation':[0,2,0]," RIGID("'motion':{},'collider':{'geometry':{'shape':1},'collisionFilter':0}") "},"
        "{'name':'ball','translation':[3,2,0]," RIGID("'motion':{},'collider':{'geometry':{'shape':1},'collisionFilter':2}") "},"
        "{'name':'gate','translation':[3,1,0]," RIGID("'trigger':{'geometry':{'shape':4}}") "}"));
    bool entered = false;
    for (int i = 0; i < 120; i++) {
        steps(world, 1);
        size_t count;
        const es_contact_event* events = es_world_contact_events(world, &count);
        for (size_t k = 0; k < count; k++) entered |= events[k].sensor && events[k].enter && (events[k].a.id == body_at(world, "ball").id || events[k].b.id == body_at(world, "ball").id);
    }
    assert_true(entered);
    near(state_of(world, "ball").position[1], 0.5, 0.02); /* fell through the gate, not through the floor */
    assert_true(state_of(world, "ghost").position[1] < -5);
    es_world_destroy(world);
}

#define LOCKED "{'linearAxes':[0,1,2],'min':0,'max':0}"
#define JOINTS "'physicsJoints':[{'limits':[" LOCKED ",{'angularAxes':[0,2],'min':0,'max':0}],'drives':[{'type':'angular','axis':1,'velocityTarget':2,'maxForce':100}]}," \
    "{'limits':[" LOCKED ",{'angularAxes':[0,1,2],'min':0,'max':0}]},{'limits':[" LOCKED "]},{'limits':[{'linearAxes':[0,1,2],'max':2}]},{'limits':[{'linearAxes':[0,1],'min':0,'max':0}]}]"
#define BALL(name, x, joint) "{'name':'" name "','translation':[" x ",0,0]," RIGID("'motion':{'mass':1}," COLLIDER("1") ",'joint':{'connectedNode':0,'joint':" joint "}") "}"

static void joints(void** state)
{
    es_world* world = load(FILE_JSON(JOINTS, SHAPES,
        "{'name':'post','translation':[0,0,0]},{'name':'wheel'," RIGID("'motion':{'mass':1}," COLLIDER("1") ",'joint':{'connectedNode':0,'joint':0}") "},"
        "{'name':'fixed','translation':[5,0,0],'children':[3]," RIGID("'motion':{'mass':1}," COLLIDER("1")) "},{'translation':[1,0,0]," RIGID("'joint':{'connectedNode':4,'joint':1}") "},"
        "{'name':'anchor','translation':[6,0,0]},"
        "{'name':'pendulum','translation':[-5,0,0],'children':[6]," RIGID("'motion':{'mass':1}," COLLIDER("1")) "},{'translation':[1,0,0]," RIGID("'joint':{'connectedNode':7,'joint':2}") "},"
        "{'translation':[-4,0,0]},"
        "{'name':'leash','translation':[0,0,10]," RIGID("'motion':{'mass':1}," COLLIDER("1") ",'joint':{'connectedNode':9,'joint':3}") "},{'translation':[0,0,10]},"
        "{'name':'slider','translation':[0,0,20]," RIGID("'motion':{'mass':1}," COLLIDER("1") ",'joint':{'connectedNode':0,'joint':4}") "}"));
    assert_int_equal(count_of(world, ES_OBJECT_JOINT), 4);
    assert_non_null(strstr(fixture.log, "1 joints are left out"));
    steps(world, 120);
    es_body_state wheel = state_of(world, "wheel"), fixed = state_of(world, "fixed"), pendulum = state_of(world, "pendulum"), leash = state_of(world, "leash");
    for (int k = 0; k < 3; k++) near(wheel.position[k], 0, 0.02);
    near(fabsf(wheel.angular_velocity.y), 2, 0.05);
    near(wheel.angular_velocity.x, 0, 0.05);
    near(fixed.position[0], 5, 0.05), near(fixed.position[1], 0, 0.05);
    double dx = pendulum.position[0] + 4, dy = pendulum.position[1];
    near(sqrt(dx * dx + dy * dy), 1, 0.02);
    near(leash.position[1], -2, 0.1);
    es_world_destroy(world);
}

#define EXTRAS(members) "'extras':{'earthshine':{" members "}}"

static void extras(void** state)
{
    es_world* world = load(FILE_JSON("", "",
        "{'name':'floor','translation':[0,-1,0]," EXTRAS("'body':{'type':'static','shape':'box','size':[20,2,20]}") "},"
        "{'name':'rock','mesh':0,'scale':[2,2,2],'translation':[0,1,0]," EXTRAS("'body':{'mass':4}") "},"
        "{'name':'fit','mesh':0,'translation':[5,1,0]," EXTRAS("'body':{'shape':'box'}") "},"
        "{'name':'ball','translation':[-5,1,0]," EXTRAS("'body':{'shape':'sphere','radius':0.5,'density':100,'velocity':[0,1,0],'gravityScale':0.5}") "},"
        "{'name':'ramp','mesh':0,'translation':[0,0,8]," EXTRAS("'body':{'type':'static'}") "},"
        "{'name':'dumbbell','translation':[5,1,5]," EXTRAS("'body':{'shapes':[{'shape':'sphere','radius':0.5,'position':[-1,0,0]},{'shape':'sphere','radius':0.5,'position':[1,0,0]}]}") "},"
        "{'name':'lamp','translation':[-5,5,5]," EXTRAS("'body':{'shape':'capsule','radius':0.1,'height':0.4},'joint':{'type':'ball'}") "},"
        "{'name':'below','translation':[-5,4,5]," EXTRAS("'body':{'shape':'sphere','radius':0.1},'joint':{'type':'distance','to':6}") "}"));
    assert_int_equal(count_of(world, ES_OBJECT_BODY), 8);
    assert_int_equal(count_of(world, ES_OBJECT_JOINT), 2);
    near(state_of(world, "rock").mass, 4, 1e-6);
    near(state_of(world, "fit").local_centre.x, 0.5, 1e-5);
    near(state_of(world, "fit").mass, 1000, 0.1);
    near(state_of(world, "ball").mass, 100 * 4.0 / 3 * 3.14159265 * 0.125, 0.01);
    near(state_of(world, "dumbbell").local_centre.x, 0, 1e-6);
    steps(world, 150);
    near(state_of(world, "ball").position[1], 0.5, 0.02);
    near(state_of(world, "fit").position[1], 0, 0.02);
    near(state_of(world, "lamp").position[1], 5, 0.02);
    near(state_of(world, "below").position[1], 4, 0.02);
    es_world_destroy(world);
}

static void cloth(void** state)
{
    es_world* world = load(FILE_JSON("", "", "{'name':'flag','mesh':0,'translation':[0,3,0]," EXTRAS("'cloth':{'mass':0.5,'pins':[1],'pinsAbove':0.5,'drag':0,'selfCollision':true}") "},"
        "{'mesh':1,'translation':[0,1,0]," EXTRAS("'cloth':{'solid':0.25,'mass':2}") "}"));
    assert_int_equal(count_of(world, ES_OBJECT_SOFT), 2);
    steps(world, 30);
    const es_raster_mesh* mesh = es_world_draw_list(world)->instances[0].mesh;
    near(mesh->positions[4], 1, 1e-3), near(mesh->positions[5], 0, 1e-3);     /* pinned by its number */
    near(mesh->positions[8], 0, 1e-3), near(mesh->positions[9], 1, 1e-3);     /* by its height */
    assert_true(mesh->positions[13] < -0.05f);                                 /* the corner at z = 1 swings down */
    es_world_destroy(world);
}

static void damaged(void** state)
{
#define NODE(members) FILE_JSON(JOINTS ",'physicsMaterials':[{'dynamicFriction':-1},{'frictionCombine':'mean'},7],'collisionFilters':[{'collisionSystems':[3]}]", \
    SHAPES ",{'type':'cone'},{'type':'sphere','sphere':{'radius':-2}},{},{'type':'capsule','capsule':{'radiusBottom':0,'radiusTop':0}}", "{},{'mesh':0," members "}")
    static const struct { const char *part, *json; } cases[] = {
        {"nodes[1].extensions.KHR_physics_rigid_bodies.motion: must be an object", NODE(RIGID("'motion':3"))},
        {"motion.mass", NODE(RIGID("'motion':{'mass':-1}"))},
        {"motion.mass: must be a number", NODE(RIGID("'motion':{'mass':'heavy'}"))},
        {"motion.linearVelocity", NODE(RIGID("'motion':{'linearVelocity':[1,2]}"))},
        {"motion.isKinematic", NODE(RIGID("'motion':{'isKinematic':1}"))},
        {"either a shape or a node", NODE(RIGID("'collider':{'geometry':{}}"))},
        {"either a shape or a node", NODE(RIGID("'collider':{'geometry':{'shape':0,'node':1}}"))},
        {"number 99 of shapes", NODE(RIGID("'collider':{'geometry':{'shape':99}}"))},
        {"whole number", NODE(RIGID("'collider':{'geometry':{'shape':0.5}}"))},
        {"whole number below 2", NODE(RIGID("'collider':{'geometry':{'node':2}}"))},
        {"has no mesh", NODE(RIGID("'collider':{'geometry':{'node':0}}"))},
        {"shapes[5].type: must be one of", NODE(RIGID(COLLIDER("5")))},
        {"shapes[6].sphere.radius", NODE(RIGID(COLLIDER("6")))},
        {"shapes[7].type: is absent", NODE(RIGID(COLLIDER("7")))},
        {"a radius that is not zero", NODE(RIGID(COLLIDER("8")))},
        {"physicsMaterials[0].dynamicFriction", NODE(RIGID("'collider':{'geometry':{'shape':0},'physicsMaterial':0}"))},
        {"frictionCombine: must be one of average", NODE(RIGID("'collider':{'geometry':{'shape':0},'physicsMaterial':1}"))},
        {"no object", NODE(RIGID("'collider':{'geometry':{'shape':0},'physicsMaterial':2}"))},
        {"array of strings", NODE(RIGID("'collider':{'geometry':{'shape':0},'collisionFilter':0}"))},
        {"flat", NODE("'scale':[1,0,1]," RIGID(COLLIDER("0")))},
        {"needs connectedNode", NODE(RIGID("'motion':{},'joint':{'joint':0}"))},
        {"number 9 of physicsJoints", NODE(RIGID("'motion':{},'joint':{'connectedNode':0,'joint':9}"))},
        {"connects a body with itself", NODE(RIGID("'joint':{'connectedNode':0,'joint':0}"))},
        {"below a node that is scaled", FILE_JSON("", SHAPES, "{'scale':[2,2,2],'children':[1]},{" RIGID("'motion':{}," COLLIDER("1")) "}")},
        {"extras.earthshine.body: must be an object", NODE(EXTRAS("'body':1"))},
        {"body.type: must be one of static, kinematic, dynamic", NODE(EXTRAS("'body':{'type':'solid'}"))},
        {"body.shape: must be one of", NODE(EXTRAS("'body':{'shape':'cone'}"))},
        {"body.shapes[1]", NODE(EXTRAS("'body':{'shapes':[{'shape':'box'},5]}"))},
        {"body.friction", NODE(EXTRAS("'body':{'friction':-2}"))},
        {"joint.to: names a node that is no body", NODE(EXTRAS("'body':{},'joint':{'to':0}"))},
        {"joint.type", NODE(EXTRAS("'body':{},'joint':{'type':'weld'}"))},
        {"needs a mesh", FILE_JSON("", "", "{" EXTRAS("'body':{}") "}")},
        {"cloth: must be an object", NODE(EXTRAS("'cloth':[1]"))},
        {"cloth.mass", NODE(EXTRAS("'cloth':{'mass':0}"))},
        {"cloth.pins[1]", NODE(EXTRAS("'cloth':{'pins':[0,4]}"))},
        {"cloth.solid", NODE(EXTRAS("'cloth':{'solid':0.5,'pins':[0]}"))},
        {"cloth: needs a mesh", FILE_JSON("", "", "{" EXTRAS("'cloth':{'mass':1}") "}")},
        {"needs its size", FILE_JSON("", "", "{" EXTRAS("'body':{'shape':'box'}") "}")},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) refuse(cases[i].part, cases[i].json);
}

/* What a clip moves is not left to the solver, in whichever way the clip names it. */
static void animated(void** state)
{
#define MOVED(extensions, target) "{'asset':{'version':'2.0'}," extensions "'buffers':[{'byteLength':32,'uri':'data:application/octet-stream;base64,AAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAA='}]," \
    "'bufferViews':[{'buffer':0,'byteLength':8},{'buffer':0,'byteOffset':8,'byteLength':24}]," \
    "'accessors':[{'bufferView':0,'componentType':5126,'count':2,'type':'SCALAR','min':[0],'max':[1]},{'bufferView':1,'componentType':5126,'count':2,'type':'VEC3'}]," \
    "'animations':[{'samplers':[{'input':0,'output':1}],'channels':[{'sampler':0,'target':{" target "}}]}]," \
    "'nodes':[{'name':'lift','children':[1]},{'name':'load'," EXTRAS("'body':{'shape':'sphere','radius':0.5}") "},{'name':'free'," EXTRAS("'body':{'shape':'sphere','radius':0.5}") "}]}"
    static const char* const files[] = {
        MOVED("", "'node':0,'path':'translation'"),
        MOVED("'extensionsUsed':['KHR_animation_pointer'],", "'path':'pointer','extensions':{'KHR_animation_pointer':{'pointer':'/nodes/0/translation'}}"),
    };
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        es_world* world = load(files[i]);
        assert_int_equal(state_of(world, "load").type, ES_BODY_KINEMATIC); /* its parent is moved */
        assert_int_equal(state_of(world, "free").type, ES_BODY_DYNAMIC);
        es_world_destroy(world);
    }
#undef MOVED
}

int main(void)
{
#ifndef ES_WITH_TINYGLTF
    return 77;
#endif
    const struct CMUnitTest tests[] = {cmocka_unit_test(falling), cmocka_unit_test(filters_and_triggers), cmocka_unit_test(joints), cmocka_unit_test(extras), cmocka_unit_test(cloth), cmocka_unit_test(animated), cmocka_unit_test(damaged)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
