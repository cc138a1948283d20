/* Settings of a struct, described by a table of es_setting, from and to text. */
#ifndef EARTHSHINE_PLATFORM_SETTINGS_H
#define EARTHSHINE_PLATFORM_SETTINGS_H

#include "platform/platform.h"

/* Writes every default into the struct. */
void es_settings_defaults(const es_setting* table, size_t count, void* settings);
const es_setting* es_settings_find(const es_setting* table, size_t count, const char* name);
/* SETTING_UNKNOWN names the nearest known setting (edit distance); SETTING_VALUE says what would be accepted. Nothing is
 * written on failure. Numbers are parsed independently of the locale. */
es_result es_settings_set(es_context* context, const es_setting* table, size_t count, void* settings, const char* name, const char* value);
/* The value as text that es_settings_set takes back; false when the buffer is too small. */
bool es_settings_get(const es_setting* setting, const void* settings, char* text, size_t size);
/* The known name nearest to `name` over all tables given one after another; used for messages. */
const char* es_settings_nearest(const es_setting* const* tables, const size_t* counts, size_t table_count, const char* name);
/* Checks every value of the struct against its range; SETTING_VALUE names the first that is outside. */
es_result es_settings_check(es_context* context, const es_setting* table, size_t count, const void* settings);

#endif
