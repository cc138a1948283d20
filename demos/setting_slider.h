/* Settings as sliders: from a value to a place on a bar and back, steps of the arrow keys, texts. */
#ifndef EARTHSHINE_DEMO_SETTING_SLIDER_H
#define EARTHSHINE_DEMO_SETTING_SLIDER_H

#include <earthshine/platform.h>

enum { SETTING_TEXT_SIZE = 64 };

/* A setting's value as a number: 0 or 1, a whole number, a choice's index. */
double setting_value(const es_setting* setting, const void* settings);
void setting_store(const es_setting* setting, void* settings, double value);
double setting_default(const es_setting* setting);
/* As es_settings_set and --set take it; floats with as few digits as give the same float back. */
void setting_text(const es_setting* setting, double value, char text[SETTING_TEXT_SIZE]);
/* False when it is no number, no choice or out of range. */
bool setting_parse(const es_setting* setting, const char* text, double* value);

/* 0 … 1 along the bar: evenly where the default is a good part of the range, else evenly in the logarithm beyond a part of the default,
 * so that 0.026 of 0 … 1 and 16000 of 0 … 1e9 can both be aimed at. */
float setting_fraction(const es_setting* setting, double value);
/* Rounded to what a hand can mean: whole numbers, three digits. */
double setting_at_fraction(const es_setting* setting, float fraction);
/* `steps` round values up or down, at least one representable step, within the range. */
double setting_stepped(const es_setting* setting, double value, int steps);
uint32_t setting_choice_count(const es_setting* setting);

/* The nearest value to `wanted` that is not `now` and that accepts(user, value) takes, looking at `wanted` itself, and then in the direction
 * of the change at powers of two and multiples of 64, which some settings must be; `now` when none is. */
double setting_accepted(const es_setting* setting, double now, double wanted, bool (*accepts)(void* user, double value), void* user);

#endif
