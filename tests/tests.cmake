# The tests. tests/run builds and runs all of them in several configurations; `ctest` in a build folder runs this one's.
#
# test_*.c and check_*.c are programs linked with the static library, with cmocka and with the private headers; check_*.c
# compare kernels with their scalar bodies and are built for other processors too. *.sh are called as `bash SCRIPT BUILD_DIR SOURCE_DIR` and may skip with exit 77. A new file is picked up by its name alone.
# stress/*.c try to break numbers: scales, places, shapes, lights and cameras out of the ordinary; they become stress_*.
# Labels: unit (the programs), stress, threaded (those that make contexts of several threads), script.

if(NOT EARTHSHINE_TESTS)
  return()
endif()
enable_testing()
if(EARTHSHINE_FUZZ)
  include(${CMAKE_SOURCE_DIR}/tests/fuzz/fuzz.cmake)
  return()
endif()

# Prints the hash of every image of a few small frames; the determinism matrix and the goldens compare its output. It
# needs no test library, so that it can be built for a machine that has none.
add_executable(frame_hashes ${CMAKE_SOURCE_DIR}/tests/frame_hashes.c)
target_link_libraries(frame_hashes PRIVATE earthshine)
target_compile_options(frame_hashes PRIVATE ${warning_flags} ${exact_flags})

# In a cross build, pkg-config would find the building machine's own.
find_package(PkgConfig)
if(PkgConfig_FOUND AND NOT CMAKE_CROSSCOMPILING)
  pkg_check_modules(CMOCKA IMPORTED_TARGET cmocka)
endif()
if(NOT CMOCKA_FOUND AND NOT CMAKE_CROSSCOMPILING)
  message(FATAL_ERROR "the tests need cmocka (Debian: libcmocka-dev); tests/run installs it, -DEARTHSHINE_TESTS=OFF does without")
endif()

# A sanitizer makes the same test several times slower.
set(test_seconds 300)
if(EARTHSHINE_SANITIZE)
  set(test_seconds 900)
endif()

set(test_environment
  "ASAN_OPTIONS=detect_leaks=1:abort_on_error=0:allocator_may_return_null=1"
  "UBSAN_OPTIONS=print_stacktrace=1"
  "TSAN_OPTIONS=halt_on_error=1:second_deadlock_stack=1")

file(GLOB test_programs CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/tests/check_*.c)
if(CMOCKA_FOUND)
  file(GLOB more_programs CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/tests/test_*.c)
  file(GLOB stress_programs CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/tests/stress/*.c)
  list(APPEND test_programs ${more_programs} ${stress_programs})
else()
  message(STATUS "no cmocka for ${CMAKE_SYSTEM_PROCESSOR}: of the unit tests only check_*.c are built, with tests/without_cmocka")
endif()
foreach(source ${test_programs})
  get_filename_component(name ${source} NAME_WE)
  set(labels unit)
  if(source MATCHES "/stress/")
    set(name stress_${name})
    set(labels stress)
  endif()
  add_executable(${name} ${source})
  # parts of the program that stand alone, by the header
  file(STRINGS ${source} demo_headers REGEX "^#include \"demos/")
  foreach(line ${demo_headers})
    string(REGEX REPLACE "^#include \"(demos/[a-z_]+)\\.h\".*" "\\1.c" demo_source ${line})
    target_sources(${name} PRIVATE ${CMAKE_SOURCE_DIR}/${demo_source})
  endforeach()
  target_link_libraries(${name} PRIVATE earthshine Threads::Threads m)
  if(CMOCKA_FOUND)
    target_link_libraries(${name} PRIVATE PkgConfig::CMOCKA)
  else()
    target_include_directories(${name} PRIVATE ${CMAKE_SOURCE_DIR}/tests/without_cmocka)
  endif()
  target_include_directories(${name} PRIVATE ${CMAKE_SOURCE_DIR} ${CMAKE_BINARY_DIR}/include)
  target_compile_options(${name} PRIVATE ${warning_flags} ${exact_flags} -Wno-psabi)
  target_compile_definitions(${name} PRIVATE ES_TEST_SOURCE_DIR="${CMAKE_SOURCE_DIR}" ES_TEST_BUILD_DIR="${CMAKE_BINARY_DIR}")
  foreach(isa ${isas})
    string(TOUPPER ${isa} upper)
    target_compile_definitions(${name} PRIVATE ES_BUILT_${upper}=1)
  endforeach()
  foreach(library OPENEXR PNG GLFW TINYGLTF)
    if(EARTHSHINE_WITH_${library})
      target_compile_definitions(${name} PRIVATE ES_WITH_${library}=1)
    endif()
  endforeach()
  add_test(NAME ${name} COMMAND ${name} WORKING_DIRECTORY ${CMAKE_BINARY_DIR})
  file(STRINGS ${source} threads_used REGEX "threads *= *([2-9]|[a-z])" LIMIT_COUNT 1)
  if(threads_used)
    list(APPEND labels threaded)
    list(APPEND threaded_programs ${name})
  endif()
  set_tests_properties(${name} PROPERTIES LABELS "${labels}" TIMEOUT ${test_seconds} SKIP_RETURN_CODE 77 ENVIRONMENT "${test_environment}")
endforeach()

# Every pass of a frame on three threads: what a sanitizer has to see. `room` and `hall` are more triangles for the passes of the others.
set(frame_scenes "")
if(EARTHSHINE_SANITIZE STREQUAL thread)
  set(frame_scenes cornell parts cornell-stack creature curtain maze rain-of-things)
endif()
add_test(NAME frame COMMAND frame_hashes --threads 3 ${frame_scenes} WORKING_DIRECTORY ${CMAKE_BINARY_DIR})
set_tests_properties(frame PROPERTIES LABELS "unit;threaded" TIMEOUT ${test_seconds} ENVIRONMENT "${test_environment}")
# what a build for `ctest -L threaded` needs
add_custom_target(threaded_tests DEPENDS frame_hashes ${threaded_programs})

if(NOT CMAKE_CROSSCOMPILING)
  include(${CMAKE_SOURCE_DIR}/tests/fuzz/fuzz.cmake)
endif()

# The scripts look at objects, installed files and figures, which a sanitizer changes.
if(NOT EARTHSHINE_SANITIZE)
  file(GLOB test_scripts CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/tests/*.sh)
  foreach(source ${test_scripts})
    get_filename_component(name ${source} NAME_WE)
    if(name MATCHES "^(helpers|.*_helpers)$")
      continue()
    endif()
    add_test(NAME ${name} COMMAND bash ${source} ${CMAKE_BINARY_DIR} ${CMAKE_SOURCE_DIR} WORKING_DIRECTORY ${CMAKE_BINARY_DIR})
    set_tests_properties(${name} PROPERTIES LABELS script TIMEOUT 600 SKIP_RETURN_CODE 77)
  endforeach()
endif()

# The longest first (CPU seconds of a release build), so that none is left alone at the end with processors idle.
set(longest determinism 70 test_scarcity 40 cli 27 format 27 stress_triangles 15 stress_endurance 15 frame 15 stress_cameras 10 stress_lights 10 stress_scale 10
  test_vpl_traced 10 test_integrating_sphere 8 test_micro_pass 8 test_bounces 7 test_raster 7 test_peer_room 7)
while(longest)
  list(POP_FRONT longest name seconds)
  if(TEST ${name})
    set_tests_properties(${name} PROPERTIES COST ${seconds})
  endif()
endwhile()
