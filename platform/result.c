/* Names and texts of the results, from the one list in platform.h. */
#include "platform/platform.h"

const char* es_result_name(es_result result)
{
    static const char* const names[ES_RESULT_COUNT] = {
#define ES_RESULT_NAME(name, text) #name,
        ES_RESULTS(ES_RESULT_NAME)
#undef ES_RESULT_NAME
    };
    return (uint32_t)result < ES_RESULT_COUNT ? names[result] : "?";
}

const char* es_result_text(es_result result)
{
    static const char* const texts[ES_RESULT_COUNT] = {
#define ES_RESULT_TEXT(name, text) text,
        ES_RESULTS(ES_RESULT_TEXT)
#undef ES_RESULT_TEXT
    };
    return (uint32_t)result < ES_RESULT_COUNT ? texts[result] : "?";
}
