# Compiles one kernel source once per instruction set and adds the objects to a target.
#
# Each copy sees DIFFNEA_ISA, a bare identifier: sse2, avx2 or (not with clang) avx512 on x86-64, base elsewhere. Every
# entry point must carry that name (a namespace or a suffix), the caller chooses one by __builtin_cpu_supports.
#
# Inline functions and templates that do not carry the name (std::, Eigen) are emitted in every copy under one
# symbol; the linker would keep one copy for the whole program, perhaps the AVX-512 one, and an older processor would
# stop with an illegal instruction. So those symbols are made local to their copy.
function(diffnea_add_isa_kernels target source)
  get_filename_component(stem "${source}" NAME_WE)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$")
    set(isas sse2 avx2)
    set(march_sse2 x86-64)
    set(march_avx2 x86-64-v3)
    set(march_avx512 x86-64-v4)
    target_compile_definitions(${target} PRIVATE DIFFNEA_HAS_X86_KERNELS)
    # clang 19 over libstdc++ 12: masks of <experimental/simd> hold nothing with AVX-512, and select() returns one side.
    if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
      target_compile_definitions(${target} PRIVATE DIFFNEA_NO_AVX512_KERNELS)
    else()
      list(APPEND isas avx512)
    endif()
  else()
    set(isas base)
  endif()
  foreach(isa IN LISTS isas)
    set(copy ${target}_${stem}_${isa})
    add_library(${copy} OBJECT "${source}")
    diffnea_target_defaults(${copy})
    target_include_directories(${copy} PRIVATE "$<TARGET_PROPERTY:${target},INCLUDE_DIRECTORIES>")
    target_link_libraries(${copy} PRIVATE diffnea::dynamics)
    target_compile_definitions(${copy} PRIVATE DIFFNEA_COMPILED DIFFNEA_ISA=${isa})
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      # GCC bug 105593: its own AVX-512 intrinsics start from a variable that is undefined on purpose.
      target_compile_options(${copy} PRIVATE -Wno-uninitialized -Wno-maybe-uninitialized)
      # "Unique" symbols (constants of std::experimental::simd, in builds without optimisation) cannot be made local.
      target_compile_options(${copy} PRIVATE -fno-gnu-unique)
    endif()
    if(march_${isa})
      target_compile_options(${copy} PRIVATE -march=${march_${isa}})
    endif()
    set(object "${CMAKE_CURRENT_BINARY_DIR}/${stem}_${isa}.o")
    add_custom_command(
      OUTPUT "${object}"
      COMMAND "${CMAKE_LINKER}" -r --force-group-allocation -o "${object}" $<TARGET_OBJECTS:${copy}>
      # clang's AddressSanitizer registers the globals of a program once, and remembers it in that symbol.
      COMMAND "${CMAKE_OBJCOPY}" --wildcard --keep-global-symbol=*${isa}*
        --keep-global-symbol=___asan_globals_registered "${object}"
      DEPENDS $<TARGET_OBJECTS:${copy}>
      COMMAND_EXPAND_LISTS VERBATIM
      COMMENT "Localising shared symbols of ${stem} for ${isa}")
    set_source_files_properties("${object}" PROPERTIES EXTERNAL_OBJECT ON GENERATED ON)
    target_sources(${target} PRIVATE "${object}")
  endforeach()
endfunction()
