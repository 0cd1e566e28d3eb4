/* Inline: a kernel that is compiled anew for the constants it is called with, such as the dimension. */
#pragma once

#define INLINE static inline __attribute__((always_inline))
