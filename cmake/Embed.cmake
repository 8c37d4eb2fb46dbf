# Writes a C++ source that holds files, as the assembler reads them: -DOUTPUT -DFUNCTION -DFILES=a,b,...
string(REPLACE "," ";" FILES "${FILES}")
set(symbols "")
set(entries "")
set(number 0)
foreach(file IN LISTS FILES)
  get_filename_component(name "${file}" NAME)
  file(SIZE "${file}" size)
  set(symbol "embedded_${FUNCTION}_${number}")
  string(APPEND symbols "__asm__(\".section .rodata\\n${symbol}: .incbin \\\"${file}\\\"\\n.byte 0\\n.previous\\n\");\n"
                        "extern \"C\" const char ${symbol}[] __attribute__((visibility(\"hidden\")));\n")
  string(APPEND entries "    {\"${name}\", {${symbol}, ${size}}},\n")
  math(EXPR number "${number} + 1")
endforeach()
file(WRITE "${OUTPUT}" "#include \"sensing/core/embedded_file.h\"\n\n${symbols}
namespace taclink {
std::span<const EmbeddedFile> ${FUNCTION}() {
  static const EmbeddedFile kFiles[] = {\n${entries}  };
  return kFiles;
}
}  // namespace taclink
")
