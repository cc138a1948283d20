/* Which vertices a block of leaves needs, and where among them each leaf's corners are: refitting then reads each vertex once, in order, and leaves find
 * theirs in the cache. Only places where leaves are placed or change their order alter it. */
#include <string.h>

#include "gi/micro/forest_parts.h"
#include "platform/context.h"

enum { MOST = 3 * ES_TREE_BLOCK, SLOTS = 16384, FREE = 0xffff }; /* a table at most three eighths full */

static void link_block(const es_point_forest* forest, es_tree_task* task, uint16_t* table)
{
    const struct es_forest_private* own = forest->own;
    const es_point_tree* tree = &forest->trees[task->tree];
    const es_tree_state* state = &own->states[task->tree];
    const uint32_t size = tree->leaf_count < ES_TREE_BLOCK ? tree->leaf_count : ES_TREE_BLOCK, begin = task->block * size;
    const size_t at = state->corner + 3 * (size_t)begin;
    const uint32_t *indices = state->mesh->indices, *triangle = forest->triangle + tree->first_leaf + begin;
    uint32_t *vertices = own->vertices + at, count = 0;
    uint16_t* corners = own->corners + at;
    memset(table, 0xff, SLOTS * sizeof *table);
    for (uint32_t leaf = 0; leaf < size; leaf++)
        for (uint32_t c = 0; c < 3; c++) {
            const uint32_t vertex = indices[3 * (size_t)triangle[leaf] + c];
            uint32_t slot = vertex * 2654435769u >> 18;
            while (table[slot] != FREE && vertices[table[slot]] != vertex) slot = (slot + 1) % SLOTS;
            if (table[slot] == FREE) {
                table[slot] = (uint16_t)count;
                vertices[count++] = vertex;
            }
            corners[leaf / 8 * 24 + 8 * c + leaf % 8] = (uint16_t)(2 * table[slot]);
        }
    for (; count % 8; count++) vertices[count] = vertices[count - 1];
    task->vertex_count = count;
}

static void link_some(void* user, uint32_t first, uint32_t last, uint32_t worker)
{
    (void)worker;
    const es_point_forest* forest = user;
    uint16_t table[SLOTS];
    for (uint32_t i = first; i < last; i++) {
        const es_tree_state* state = &forest->own->states[forest->own->tasks[i].tree];
        if (state->work && !state->linked) link_block(forest, &forest->own->tasks[i], table);
    }
}

void es_forest_link(es_context* context, es_point_forest* forest)
{
    struct es_forest_private* own = forest->own;
    bool any = false;
    for (uint32_t i = 0; i < forest->tree_count; i++) any = any || (own->states[i].work && !own->states[i].linked);
    if (!any) return;
    es_parallel_for(context, (uint32_t)own->task_count, 4, link_some, forest);
    for (uint32_t i = 0; i < forest->tree_count; i++) own->states[i].linked = own->states[i].linked || own->states[i].work;
}
