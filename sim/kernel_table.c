/* The world floor's kernel tables by instruction set. */
#include "sim/kernel_table.h"
#include "platform/kernel.h"

ES_KERNEL_TABLE(es_sim)
