interface NumberFieldProps {
  label: string;
  unit: string;
  /** In a form. */
  name?: string;
  /** At first; undefined: empty. */
  value?: number;
  /** What is in force, where the field may stay empty. */
  placeholder?: string;
  min?: number;
  max?: number;
  step?: number;
  /** Once it is entered. */
  onNumber?: (value: number) => void;
}

/** A number with its unit; one out of its range is not taken. */
export function NumberField(props: NumberFieldProps) {
  const { label, unit, name, value, placeholder, min, max, step, onNumber } = props;
  const range = min === undefined || max === undefined ? undefined : `${min} to ${max} ${unit}`.trim();
  return (
    <label title={range}>
      {label}{" "}
      <input
        type="number"
        name={name}
        min={min}
        max={max}
        step={step ?? "any"}
        placeholder={placeholder}
        defaultValue={value === undefined ? "" : String(value)}
        onChange={(event) => {
          const { valueAsNumber, validity } = event.currentTarget;
          const isInRange = !validity.rangeUnderflow && !validity.rangeOverflow && !validity.badInput;
          if (isInRange && Number.isFinite(valueAsNumber)) onNumber?.(valueAsNumber);
        }}
      />{" "}
      {unit}
    </label>
  );
}
