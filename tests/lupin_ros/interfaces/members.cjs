// What TypeScript's own compiler makes of a module: `node members.cjs TYPESCRIPT MODULE.ts` prints, as JSON,
// what is wrong with it under --strict, the members of each type with their types, and the values of constants.
const ts = require(process.argv[2]);
const file = process.argv[3];
const options = {
  strict: true, exactOptionalPropertyTypes: true, noUncheckedIndexedAccess: true, isolatedModules: true,
  noEmit: true, skipLibCheck: false, target: ts.ScriptTarget.ES2022, module: ts.ModuleKind.ESNext,
};
const program = ts.createProgram([file], options);
const checker = program.getTypeChecker();
const problems = ts.getPreEmitDiagnostics(program).map(
  (one) => ts.flattenDiagnosticMessageText(one.messageText, "\n"));
const types = {};
const values = {};
const told = (symbol) => checker.typeToString(checker.getTypeOfSymbol(symbol), undefined,
  ts.TypeFormatFlags.NoTruncation);
for (const symbol of checker.getExportsOfModule(checker.getSymbolAtLocation(program.getSourceFile(file)))) {
  const name = symbol.getName();
  if (symbol.flags & (ts.SymbolFlags.Interface | ts.SymbolFlags.TypeAlias)) {
    const type = checker.getDeclaredTypeOfSymbol(symbol);
    types[name] = Object.fromEntries(type.getProperties().map(
      (one) => [one.getName(), { type: told(one).replace(/ \| undefined$/, ""), optional: !!(one.flags & ts.SymbolFlags.Optional) }]));
  }
  if (symbol.flags & ts.SymbolFlags.Variable) {
    values[name] = Object.fromEntries(checker.getTypeOfSymbol(symbol).getProperties().map(
      (one) => [one.getName(), JSON.parse(told(one))]));
  }
}
console.log(JSON.stringify({ problems, types, values }));
