/* This instruction set's table of the world floor's kernels. */
#include "sim/kernel_table.h"
#include "platform/kernel.h"

#define DECLARE(name, arguments) void ES_KERNEL(es_sim_##name) arguments;
ES_SIM_KERNELS(DECLARE)

const struct es_sim_kernels ES_KERNEL(es_sim_kernels) = {
#define FIELD(name, arguments) .name = ES_KERNEL(es_sim_##name),
    ES_SIM_KERNELS(FIELD)
};
