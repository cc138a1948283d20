# The earthshine program, its inexact twin for the benchmark, and the embedding example.
if(NOT EARTHSHINE_DEMOS)
  return()
endif()

find_package(Git QUIET)
set(demo_commit "unknown")
if(GIT_FOUND)
  execute_process(COMMAND ${GIT_EXECUTABLE} describe --always --dirty --tags WORKING_DIRECTORY ${CMAKE_SOURCE_DIR}
    OUTPUT_VARIABLE described OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
  if(NOT failed AND described)
    set(demo_commit "${described}")
  endif()
endif()
set(demo_compiler "${CMAKE_C_COMPILER_ID} ${CMAKE_C_COMPILER_VERSION}")
string(TOUPPER "${CMAKE_BUILD_TYPE}" build_type)

file(GLOB demo_sources RELATIVE ${CMAKE_SOURCE_DIR}/demos CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/demos/*.c)
list(REMOVE_ITEM demo_sources embed.c bench_embree_paths.c bench_start_peer.c) # the latter two are built beside a peer
list(TRANSFORM demo_sources PREPEND ${CMAKE_SOURCE_DIR}/demos/)

# earthshine_program(TARGET NAME LIBRARY FLAGS…): one program over one build of the library.
function(earthshine_program target name library)
  string(STRIP "${CMAKE_C_FLAGS} ${CMAKE_C_FLAGS_${build_type}} ${EARTHSHINE_OPTIMIZE}" demo_flags)
  list(JOIN exact_flags " " exact)
  list(JOIN ARGN " " more)
  set(demo_flags "${demo_flags} ${exact} ${more}")
  string(STRIP "${demo_flags}" demo_flags)
  configure_file(demos/demo_build.h.in ${CMAKE_BINARY_DIR}/${target}/demo_build.h @ONLY)
  add_executable(${target} ${demo_sources})
  set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name})
  target_include_directories(${target} PRIVATE ${CMAKE_BINARY_DIR}/${target})
  target_compile_options(${target} PRIVATE ${warning_flags})
  target_link_libraries(${target} PRIVATE ${library} m)
endfunction()

earthshine_program(earthshine-program earthshine earthshine)

if(EARTHSHINE_INEXACT_TWIN)
  # What bit-exactness costs: the same sources with everything the contract forbids.
  set(inexact_flags -Ofast -ffast-math -ffp-contract=fast)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    list(APPEND inexact_flags -march=native -mfma)
  endif()
  earthshine_build(earthshine_inexact ${inexact_flags})
  earthshine_program(earthshine-inexact-program earthshine-inexact earthshine_inexact ${inexact_flags})
endif()

add_executable(earthshine-embed ${CMAKE_SOURCE_DIR}/demos/embed.c)
target_link_libraries(earthshine-embed PRIVATE earthshine::earthshine)

install(TARGETS earthshine-program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
