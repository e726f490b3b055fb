# A fault of memory that came to be in spite of all is harder to make use of: stacks have guards, the C
# library's copies know the size of where they write, calls by address reach beginnings of functions
# alone where the processor watches that. core/CMakeLists.txt takes the guards back.
# tests/packages/hardening_test.py looks for each, and for those below, in the programs.
if(PROJECT_IS_TOP_LEVEL AND NOT STELLATE_SANITIZER)  # which finds more than these, that hide some of it
  include(CheckCXXCompilerFlag)
  check_cxx_compiler_flag(-fcf-protection STELLATE_HAS_CF_PROTECTION)  # x86's alone
  set(hardening -fstack-protector-strong -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2)
  if(STELLATE_HAS_CF_PROTECTION)
    list(APPEND hardening -fcf-protection)
  endif()
  add_compile_options("$<$<CONFIG:Release>:${hardening}>")
endif()

# stellate_harden(PROGRAM): the program lies at other addresses each time, its tables of functions are
# read-only once it runs, and nothing that can be written can be run.
function(stellate_harden program)
  target_link_options(${program} PRIVATE -pie -Wl,-z,relro,-z,now,-z,noexecstack)
endfunction()
