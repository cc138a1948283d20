/* The light floor's kernel tables by instruction set. */
#include "gi/kernel_table.h"
#include "platform/kernel.h"

ES_KERNEL_TABLE(es_gi)
